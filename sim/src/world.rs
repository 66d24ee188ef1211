//! A scene, a robot and a seed put together, and the truth about it.
