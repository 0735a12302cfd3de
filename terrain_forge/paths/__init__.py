"""Routes in the plane, known before the ground, and trajectories on it."""
