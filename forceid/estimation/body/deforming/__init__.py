"""Shapes in which a body deforms, and which of them markers show."""
