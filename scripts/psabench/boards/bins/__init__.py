"""БИНС, an inertial unit."""
