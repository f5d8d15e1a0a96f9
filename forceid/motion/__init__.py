"""Mean motion of a deforming body: pose, shapes that deform, derivatives by the classic routes."""
