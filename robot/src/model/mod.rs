//! The kinematic model of a robot: URDF and `robot.toml`, forward kinematics, Jacobians.
