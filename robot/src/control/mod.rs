//! The QP controller: velocities that follow a tool pose within limits and away from obstacles.
