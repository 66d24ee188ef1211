//! Clouds of labelled points in PLY files: the truth that any labelled cloud can be scored against.
//!
//! The form: `format ascii 1.0` or `format binary_little_endian 1.0`; `element vertex N` comes first and has scalar
//! properties only: `x`, `y`, `z` (`float` or `double`, metres, world frame of the map), one integer property with the
//! class of the point (named `label` unless the caller says otherwise), and optionally `area` (`float` or `double`, the
//! surface that the point stands for, square metres). Other properties and later elements (faces) are read over. Without
//! `area` every point counts alike.

use nalgebra::Point3;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Most points of a cloud: what a file claims beyond it is a mistake.
const MOST_POINTS: usize = 200_000_000;

/// Why a file is no labelled cloud.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CloudError {
    /// A line of the header or of an ASCII body.
    #[error("{}:{line}: {reason}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A place in a binary body.
    #[error("{}: byte {offset}: {reason}", file.display())]
    Byte {
        /// The file.
        file: PathBuf,
        /// Offset from the start of the file.
        offset: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
}

/// One point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelledPoint {
    /// Where, metres, world frame.
    pub position: Point3<f32>,
    /// Number of its class.
    pub label: i64,
    /// Surface that it stands for, square metres; 1 for each point when the file does not say.
    pub area_m2: f32,
}

/// All points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledCloud {
    /// In the order of the file.
    pub points: Vec<LabelledPoint>,
}

/// Types of scalar properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn find(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The value at the start of `bytes`; `None` when they are too few. Every integer type fits f64 exactly.
    fn read(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::I8 => f64::from(bytes.first()?.cast_signed()),
            Self::U8 => f64::from(*bytes.first()?),
            Self::I16 => f64::from(i16::from_le_bytes(*bytes.first_chunk()?)),
            Self::U16 => f64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Self::I32 => f64::from(i32::from_le_bytes(*bytes.first_chunk()?)),
            Self::U32 => f64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F32 => f64::from(f32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F64 => f64::from_le_bytes(*bytes.first_chunk()?),
        })
    }
}

/// What the header says.
struct Header {
    binary: bool,
    count: usize,
    properties: Vec<Scalar>,
    /// Places of x, y, z, the label and the area among the properties.
    places: [usize; 4],
    area: Option<usize>,
    /// Lines of the header, and bytes up to its end.
    lines: usize,
    bytes: usize,
}

impl LabelledCloud {
    /// Parses a file's bytes; `file` only names the source in errors, `property` the integer property with the class.
    ///
    /// # Errors
    /// [`CloudError`] with the line or the byte: what the form above does not allow, coordinates that are not finite, a
    /// body that ends too early.
    pub fn parse(bytes: &[u8], file: &Path, property: &str) -> Result<Self, CloudError> {
        let header = Header::parse(bytes, file, property)?;
        let body = bytes.get(header.bytes..).unwrap_or_default();
        if header.binary { header.read_binary(body, file) } else { header.read_ascii(body, file) }
    }

    /// The cloud as a PLY file, ASCII or binary, with the property `area`.
    pub fn to_ply(&self, binary: bool) -> Vec<u8> {
        let format = if binary { "binary_little_endian" } else { "ascii" };
        let mut text = format!(
            "ply\nformat {format} 1.0\ncomment world frame, metres, z up\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nproperty int label\nproperty float area\nend_header\n",
            self.points.len()
        );
        if !binary {
            for LabelledPoint { position: p, label, area_m2 } in &self.points {
                // Writing to a String cannot fail.
                let _ = writeln!(text, "{} {} {} {label} {area_m2}", p.x, p.y, p.z);
            }
            return text.into_bytes();
        }
        let mut bytes = text.into_bytes();
        for LabelledPoint { position: p, label, area_m2 } in &self.points {
            [p.x, p.y, p.z].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            bytes.extend((*label as i32).to_le_bytes());
            bytes.extend(area_m2.to_le_bytes());
        }
        bytes
    }
}

impl Header {
    fn parse(bytes: &[u8], file: &Path, property: &str) -> Result<Self, CloudError> {
        let (mut at, mut number) = (0, 0);
        let (mut binary, mut count) = (None, None);
        let mut properties: Vec<(String, Scalar)> = Vec::new();
        let mut in_vertices = false;
        loop {
            number += 1;
            let wrong = |reason: String| CloudError::Line { file: file.to_owned(), line: number, reason };
            let rest = bytes.get(at..).unwrap_or_default();
            let Some(end) = rest.iter().position(|byte| *byte == b'\n') else {
                let expected = if number == 1 { "`ply`" } else { "`end_header`" };
                return Err(wrong(format!("the file ends here, expected {expected}")));
            };
            at += end + 1;
            let Ok(line) = std::str::from_utf8(&rest[..end]) else {
                return Err(wrong("expected a line of a PLY header, got bytes that are no text".into()));
            };
            let words: Vec<&str> = line.split_whitespace().collect();
            match (number, words.as_slice()) {
                (1, ["ply"]) => {}
                (1, _) => return Err(wrong("expected `ply`: this is no PLY file".into())),
                (_, []) | (_, ["comment" | "obj_info", ..]) => {}
                (_, ["format", "ascii", "1.0"]) => binary = Some(false),
                (_, ["format", "binary_little_endian", "1.0"]) => binary = Some(true),
                (_, ["format", ..]) => {
                    let expected = "expected `format ascii 1.0` or `format binary_little_endian 1.0`";
                    return Err(wrong(format!("{expected}, got `{line}`")));
                }
                (_, ["element", "vertex", n]) if count.is_none() => {
                    let parsed = n.parse::<usize>().ok().filter(|n| *n <= MOST_POINTS);
                    let expected = || wrong(format!("expected a number of points up to {MOST_POINTS}, got `{n}`"));
                    count = Some(parsed.ok_or_else(expected)?);
                    in_vertices = true;
                }
                (_, ["element", _, _]) if count.is_some() => in_vertices = false,
                (_, ["element", ..]) => return Err(wrong(format!("expected `element vertex N` first, got `{line}`"))),
                (_, ["property", "list", ..]) if in_vertices => {
                    return Err(wrong("a point has scalar properties only, got a list".into()));
                }
                (_, ["property", kind, name]) if in_vertices => {
                    let scalar = Scalar::find(kind).ok_or_else(|| wrong(format!("unknown type `{kind}`")))?;
                    if properties.iter().any(|(known, _)| known == name) {
                        return Err(wrong(format!("property `{name}` is there twice")));
                    }
                    properties.push(((*name).to_owned(), scalar));
                }
                (_, ["property", ..]) if count.is_some() && !in_vertices => {}
                (_, ["end_header"]) => break,
                _ => return Err(wrong(format!("expected a line of a PLY header, got `{line}`"))),
            }
        }
        let wrong = |reason: String| CloudError::Line { file: file.to_owned(), line: number, reason };
        let find = |name: &str| properties.iter().position(|(known, _)| known == name);
        let known = || properties.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        let mut places = [0; 4];
        for (place, name) in places.iter_mut().zip(["x", "y", "z", property]) {
            let missing = || wrong(format!("a point has no property `{name}`; it has: {}", known()));
            *place = find(name).ok_or_else(missing)?;
        }
        if places[..3].iter().any(|place| properties[*place].1.is_integer()) {
            return Err(wrong("x, y and z must be float or double".into()));
        }
        if !properties[places[3]].1.is_integer() {
            return Err(wrong(format!("property `{property}` must be an integer: it is the number of a class")));
        }
        let area = find("area").filter(|place| !properties[*place].1.is_integer());
        let binary = binary.ok_or_else(|| wrong("the header has no line `format`".into()))?;
        let count = count.ok_or_else(|| wrong("the header has no line `element vertex N`".into()))?;
        let properties = properties.into_iter().map(|(_, scalar)| scalar).collect();
        Ok(Self { binary, count, properties, places, area, lines: number, bytes: at })
    }

    fn read_ascii(&self, body: &[u8], file: &Path) -> Result<LabelledCloud, CloudError> {
        let mut points = Vec::with_capacity(self.count.min(body.len() / 8));
        let mut values = Vec::with_capacity(self.properties.len());
        let mut number = self.lines;
        for line in body.split(|byte| *byte == b'\n') {
            number += 1;
            if points.len() == self.count {
                break;
            }
            let wrong = |reason: String| CloudError::Line { file: file.to_owned(), line: number, reason };
            let text =
                std::str::from_utf8(line).map_err(|_| wrong("expected numbers, got bytes that are no text".into()))?;
            if text.trim().is_empty() {
                continue;
            }
            values.clear();
            for word in text.split_whitespace() {
                values.push(word.parse::<f64>().map_err(|_| wrong(format!("expected a number, got `{word}`")))?);
            }
            let wanted = self.properties.len();
            if values.len() != wanted {
                return Err(wrong(format!("expected {wanted} numbers for a point, got {}", values.len())));
            }
            points.push(self.point(&values).map_err(wrong)?);
        }
        if points.len() < self.count {
            let reason = format!("the file ends after {} of {} points", points.len(), self.count);
            return Err(CloudError::Line { file: file.to_owned(), line: number, reason });
        }
        Ok(LabelledCloud { points })
    }

    fn read_binary(&self, body: &[u8], file: &Path) -> Result<LabelledCloud, CloudError> {
        let size: usize = self.properties.iter().map(|scalar| scalar.size()).sum();
        let mut points = Vec::with_capacity(self.count.min(body.len() / size.max(1)));
        let mut values = Vec::with_capacity(self.properties.len());
        for index in 0..self.count {
            let offset = self.bytes + index * size;
            let wrong = |reason: String| CloudError::Byte { file: file.to_owned(), offset, reason };
            let mut record = body
                .get(index * size..(index + 1) * size)
                .ok_or_else(|| wrong(format!("the file ends after {index} of {} points", self.count)))?;
            values.clear();
            for scalar in &self.properties {
                values.extend(scalar.read(record));
                record = record.get(scalar.size()..).unwrap_or_default();
            }
            points.push(self.point(&values).map_err(wrong)?);
        }
        Ok(LabelledCloud { points })
    }

    fn point(&self, values: &[f64]) -> Result<LabelledPoint, String> {
        let [x, y, z, label] = self.places.map(|place| values[place]);
        if ![x, y, z].iter().all(|c| c.is_finite()) {
            return Err("a coordinate is not finite".into());
        }
        if label.fract() != 0.0 {
            return Err(format!("expected a whole number as class, got {label}"));
        }
        let area = self.area.map_or(1.0, |place| values[place]);
        if !(area.is_finite() && area >= 0.0) {
            return Err(format!("expected an area of 0 or more, got {area}"));
        }
        Ok(LabelledPoint { position: Point3::new(x, y, z).cast(), label: label as i64, area_m2: area as f32 })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what was written is read again, in both formats; foreign headers are understood; a broken file is refused
    //! with its line or byte.
    use super::*;

    fn cloud() -> LabelledCloud {
        let point = |x: f32, label| LabelledPoint { position: Point3::new(x, -1.5, 0.1), label, area_m2: 0.25 };
        LabelledCloud { points: vec![point(0.1, 3), point(-7.25, -1), point(1e-3, 70_000)] }
    }

    fn parse(text: &str) -> Result<LabelledCloud, String> {
        LabelledCloud::parse(text.as_bytes(), "t.ply".as_ref(), "label").map_err(|error| error.to_string())
    }

    #[test]
    fn both_formats_keep_every_point() {
        for binary in [false, true] {
            let bytes = cloud().to_ply(binary);
            assert_eq!(LabelledCloud::parse(&bytes, "t.ply".as_ref(), "label"), Ok(cloud()), "binary {binary}");
        }
    }

    #[test]
    fn foreign_properties_and_elements_are_read_over() {
        let text = "ply\nformat ascii 1.0\nobj_info x\nelement vertex 2\nproperty uchar red\nproperty double x\n\
                    property double y\nproperty double z\nproperty ushort object_id\nelement face 1\n\
                    property list uchar int vertex_indices\nend_header\n9 1 2 3 4\n\n8 5 6 7 0\n3 0 1 1\n";
        let read = LabelledCloud::parse(text.as_bytes(), "t.ply".as_ref(), "object_id").unwrap();
        let short: Vec<(f32, i64, f32)> = read.points.iter().map(|p| (p.position.x, p.label, p.area_m2)).collect();
        assert_eq!(short, [(1.0, 4, 1.0), (5.0, 0, 1.0)]);
    }

    #[test]
    fn broken_files_name_the_place() {
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                      property int label\nend_header\n";
        let of = |body: &str| parse(&format!("{header}{body}")).unwrap_err();
        assert_eq!(of("0 0 0 1\n0 0 zero 1\n"), "t.ply:10: expected a number, got `zero`");
        assert_eq!(of("0 0 0 1\n0 0 1\n"), "t.ply:10: expected 4 numbers for a point, got 3");
        assert_eq!(of("0 0 0 1.5\n"), "t.ply:9: expected a whole number as class, got 1.5");
        assert_eq!(of("0 nan 0 1\n"), "t.ply:9: a coordinate is not finite");
        assert!(of("0 0 0 1\n").ends_with("the file ends after 1 of 2 points"), "{}", of("0 0 0 1\n"));
        assert_eq!(parse("hello\n").unwrap_err(), "t.ply:1: expected `ply`: this is no PLY file");
        assert_eq!(parse("ply\n").unwrap_err(), "t.ply:2: the file ends here, expected `end_header`");
        let big_endian = parse("ply\nformat binary_big_endian 1.0\n").unwrap_err();
        assert!(big_endian.starts_with("t.ply:2: expected `format ascii 1.0`"), "{big_endian}");
        let without = parse(&header.replace("int label", "int class")).unwrap_err();
        assert_eq!(without, "t.ply:8: a point has no property `label`; it has: x, y, z, class");
        let mut bytes = cloud().to_ply(true);
        let whole = bytes.len();
        bytes.truncate(whole - 1);
        let cut = LabelledCloud::parse(&bytes, "t.ply".as_ref(), "label").unwrap_err().to_string();
        assert_eq!(cut, format!("t.ply: byte {}: the file ends after 2 of 3 points", whole - 20));
    }
}
