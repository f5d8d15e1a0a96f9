"""A body in parts solved: the assembly, statics and interface forces, and what a solution is worth."""
