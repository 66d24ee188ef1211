//! Images as ROS 2 has them, `sensor_msgs/msg/CompressedImage` in CDR: viewers show them, and their bytes are kept as they
//! are, where JSON would need a third more.

use super::Form;
use dsm::time::Stamp;

/// Stands before the schema's fields: little-endian CDR.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

const SCHEMA: &str = "std_msgs/Header header\nstring format\nuint8[] data\n\
    ================================================================================\n\
    MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\n\
    MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// How an image is written.
pub(super) fn form() -> Form {
    Form { encoding: "cdr", schema: Some(("sensor_msgs/msg/CompressedImage".to_owned(), "ros2msg", SCHEMA.to_owned())) }
}

/// A PNG image as a message.
pub(super) fn encode(stamp: Stamp, frame: &str, png: &[u8]) -> Vec<u8> {
    const SECOND: i64 = 1_000_000_000;
    let mut bytes = Vec::with_capacity(png.len() + frame.len() + 48);
    bytes.extend(ENCAPSULATION);
    bytes.extend((stamp.0.div_euclid(SECOND) as i32).to_le_bytes());
    bytes.extend((stamp.0.rem_euclid(SECOND) as u32).to_le_bytes());
    for text in [frame, "png"] {
        put_length(&mut bytes, text.len() + 1);
        bytes.extend(text.as_bytes());
        bytes.push(0);
    }
    put_length(&mut bytes, png.len());
    bytes.extend(png);
    bytes
}

/// Lengths stand at multiples of four behind the encapsulation, which is four bytes long itself.
fn put_length(bytes: &mut Vec<u8>, length: usize) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend((length as u32).to_le_bytes());
}

/// The PNG image of a message; `None` when it is none.
pub(super) fn find_png(message: &[u8]) -> Option<&[u8]> {
    // Encapsulation and stamp.
    let mut at = 12;
    let mut take = || -> Option<&[u8]> {
        at = usize::next_multiple_of(at, 4);
        let length: [u8; 4] = message.get(at..at + 4)?.try_into().ok()?;
        let from = at + 4;
        at = from.checked_add(u32::from_le_bytes(length) as usize)?;
        message.get(from..at)
    };
    let (_, format, png) = (take()?, take()?, take()?);
    (message.starts_with(&ENCAPSULATION) && format == b"png\0").then_some(png)
}

#[cfg(test)]
mod tests {
    //! Contract: an image comes back out of its message; what is cut off is none.
    use super::*;

    #[test]
    fn an_image_comes_back() {
        for (frame, png) in [("head_camera", &b"12345"[..]), ("", b""), ("abc", b"1"), ("abcd", b"123")] {
            let message = encode(Stamp(1_500_000_007), frame, png);
            assert_eq!(find_png(&message), Some(png));
            assert_eq!(message[4..12], [1, 0, 0, 0, 0x07, 0x65, 0xcd, 0x1d]);
            for length in 0..message.len() {
                assert_eq!(find_png(&message[..length]), None);
            }
        }
    }
}
