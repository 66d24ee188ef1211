//! Definitions of messages as `ros2msg`, for bags: a reader needs no ROS to know what is in them.

/// Types, their fields, and the types that these use.
const DEFINITIONS: &[(&str, &str, &[&str])] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n", &[]),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n", &["builtin_interfaces/Time"]),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n", &[]),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n", &[]),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", &[]),
    (
        "geometry_msgs/Pose",
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        &["geometry_msgs/Point", "geometry_msgs/Quaternion"],
    ),
    (
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        &["geometry_msgs/Vector3", "geometry_msgs/Quaternion"],
    ),
    (
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        &["geometry_msgs/Vector3"],
    ),
    (
        "geometry_msgs/TwistStamped",
        "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
        &["std_msgs/Header", "geometry_msgs/Twist"],
    ),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n", &["geometry_msgs/Pose"]),
    (
        "geometry_msgs/PoseWithCovarianceStamped",
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
        &["std_msgs/Header", "geometry_msgs/PoseWithCovariance"],
    ),
    (
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
        &["geometry_msgs/Twist"],
    ),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        &["std_msgs/Header", "geometry_msgs/Transform"],
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n", &["geometry_msgs/TransformStamped"]),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist\n",
        &["std_msgs/Header", "geometry_msgs/PoseWithCovariance", "geometry_msgs/TwistWithCovariance"],
    ),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        &["std_msgs/Header"],
    ),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n", &["std_msgs/Header"]),
    (
        "rcl_interfaces/Log",
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n",
        &["builtin_interfaces/Time"],
    ),
];

/// Between the definitions of a type and of those that it uses.
const LINE: &str = "================================================================================\n";

fn add(name: &str, found: &mut Vec<&'static str>) {
    if let Some((name, _, uses)) = DEFINITIONS.iter().find(|(known, _, _)| *known == name)
        && !found.contains(name)
    {
        found.push(name);
        uses.iter().for_each(|used| add(used, found));
    }
}

/// The definition of a type (`sensor_msgs/JointState`) with all that it uses; `None` for a type that no bag holds.
pub fn find_definition(name: &str) -> Option<String> {
    let mut found = Vec::new();
    add(name, &mut found);
    let fields = |name: &str| DEFINITIONS.iter().find(|(known, _, _)| *known == name).map(|(_, fields, _)| *fields);
    let mut text = fields(name)?.to_owned();
    for used in found.iter().skip(1) {
        text.push_str(&format!("{LINE}MSG: {used}\n{}", fields(used)?));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    //! Contract: a definition holds each type that it uses once.
    use super::*;

    #[test]
    fn a_definition_is_whole() {
        let text = find_definition("nav_msgs/Odometry").unwrap();
        for (name, _, uses) in DEFINITIONS {
            assert!(uses.iter().all(|used| DEFINITIONS.iter().any(|(known, _, _)| known == used)), "{name}");
        }
        assert_eq!(text.matches("MSG: geometry_msgs/Vector3\n").count(), 1);
        assert!(text.starts_with("std_msgs/Header header\n") && text.contains("MSG: builtin_interfaces/Time\n"));
        assert_eq!(find_definition("std_msgs/Unknown"), None);
    }
}
