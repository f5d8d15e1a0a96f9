"""Filter, smoother and likelihood as recursions: plain, in array form, as products of a scan, by filterpy."""
