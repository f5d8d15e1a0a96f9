"""The d'Alembert-Lagrange principal equations: summation operator, mass, resultants, loads."""
