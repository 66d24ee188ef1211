//! `builtin_interfaces`, `std_msgs`, `rosgraph_msgs`, `diagnostic_msgs`.

use dsm::time::Stamp;
use serde::{Deserialize, Serialize};

/// A moment, or a span since the run began when the clock is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds; negative before the epoch.
    pub sec: i32,
    /// Nanoseconds beyond them, below a thousand million.
    pub nanosec: u32,
}

/// A span of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds, rounded down.
    pub sec: i32,
    /// Nanoseconds beyond them.
    pub nanosec: u32,
}

impl From<Stamp> for Time {
    /// Moments beyond what 32 bits of seconds hold stay at the last that they hold.
    fn from(stamp: Stamp) -> Self {
        let (sec, nanosec) = (stamp.0.div_euclid(1_000_000_000), stamp.0.rem_euclid(1_000_000_000));
        Self { sec: sec.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32, nanosec: nanosec as u32 }
    }
}

impl From<Time> for Stamp {
    fn from(time: Time) -> Self {
        Stamp(i64::from(time.sec) * 1_000_000_000 + i64::from(time.nanosec))
    }
}

/// When and in which frame something holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// When.
    pub stamp: Time,
    /// The frame.
    pub frame_id: String,
}

impl Header {
    /// A header of a moment in a frame.
    pub fn new(stamp: Stamp, frame_id: &str) -> Self {
        Self { stamp: stamp.into(), frame_id: frame_id.to_owned() }
    }
}

/// A truth value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bool {
    /// The value.
    pub data: bool,
}

/// A text.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "String")]
pub struct Text {
    /// The text.
    pub data: String,
}

impl crate::messages::RosMessage for Text {
    const PACKAGE: &'static str = "std_msgs";
    const NAME: &'static str = "String";
}

/// One axis of a [`MultiArrayLayout`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayDimension {
    /// Its name.
    pub label: String,
    /// Its length.
    pub size: u32,
    /// Values between two of its places.
    pub stride: u32,
}

/// How values stand in a [`Float64MultiArray`]; empty for a plain list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayLayout {
    /// The axes.
    pub dim: Vec<MultiArrayDimension>,
    /// Values before the first.
    pub data_offset: u32,
}

/// Numbers: what `forward_command_controller` takes for velocities of joints, in the order of its joints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float64MultiArray {
    /// How they stand.
    pub layout: MultiArrayLayout,
    /// The numbers.
    pub data: Vec<f64>,
}

/// A colour, each part from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRGBA {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
    /// How opaque.
    pub a: f32,
}

/// The present moment of a simulated clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// The moment.
    pub clock: Time,
}

/// A value that a part reports of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Its name.
    pub key: String,
    /// The value as text.
    pub value: String,
}

/// How a part is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// 0 fine, 1 warning, 2 error, 3 stale.
    pub level: u8,
    /// The part.
    pub name: String,
    /// In words.
    pub message: String,
    /// The hardware.
    pub hardware_id: String,
    /// Values.
    pub values: Vec<KeyValue>,
}

/// How all parts are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When.
    pub header: Header,
    /// The parts.
    pub status: Vec<DiagnosticStatus>,
}

/// A line of a log: `rcl_interfaces/Log`, on `/rosout`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// When.
    pub stamp: Time,
    /// How bad: 10 debug, 20 info, 30 warning, 40 error, 50 fatal.
    pub level: u8,
    /// Whose.
    pub name: String,
    /// The line.
    pub msg: String,
    /// The source file.
    pub file: String,
    /// The function.
    pub function: String,
    /// The line in the file.
    pub line: u32,
}

super::named!("rcl_interfaces": Log);
super::named!("std_msgs": Bool, Float64MultiArray);
super::named!("rosgraph_msgs": Clock);
super::named!("diagnostic_msgs": DiagnosticArray);

#[cfg(test)]
mod tests {
    //! Contract: a stamp survives the way through a message, also before the epoch.
    use super::*;

    #[test]
    fn a_stamp_comes_back_as_it_was() {
        for nanoseconds in
            [0, 1, 999_999_999, 1_000_000_000, -1, -1_000_000_000, -1_500_000_000, 1_790_000_000_123_456_789]
        {
            assert_eq!(Stamp::from(Time::from(Stamp(nanoseconds))), Stamp(nanoseconds));
        }
        assert_eq!(Time::from(Stamp(-1)), Time { sec: -1, nanosec: 999_999_999 });
    }
}
