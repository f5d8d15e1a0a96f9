"""Parameters by likelihood, measurements that nothing agrees with, and whether a filter is honest."""
