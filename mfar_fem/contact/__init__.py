"""Contact: rigid bodies, separating axes between triangles, and the barrier that keeps surfaces apart."""
