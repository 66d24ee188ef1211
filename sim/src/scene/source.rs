//! The text of a scene with its includes inlined, and the way back from that text to files and lines.
//!
//! MuJoCo takes any root element in an included file, `mjcf-rs` only `<mujoco>`: so includes are inlined here, before
//! parsing. Paths of includes are relative to the main file's folder, as in MuJoCo, else to the including file's.

use super::error::{Place, SceneError};
use roxmltree::Document;
use std::path::{Path, PathBuf};

/// Whether a file is a piece for others to include and no model: its root is another element than `mujoco`, or holds what
/// stands deeper in a model.
pub(super) fn is_part(file: &Path) -> bool {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    Document::parse(&text).is_ok_and(|document| {
        let root = document.root_element();
        let mut blocks = root.children().filter(|child| child.is_element()).map(|child| child.tag_name().name());
        root.tag_name().name() != "mujoco" || blocks.any(|name| DEEPER.contains(&name))
    })
}

/// Elements that only a part has right below its root.
const DEEPER: [&str; 8] = ["body", "geom", "joint", "site", "texture", "material", "mesh", "camera"];

/// A stretch of the inlined text that stems from one file.
struct Piece {
    /// Offset in the inlined text.
    start: usize,
    /// Index into [`Source::files`].
    file: usize,
    /// Line of its first byte, counted from 1.
    line: u32,
}

/// A scene's text with its includes inlined.
pub(super) struct Source {
    /// The text.
    pub text: String,
    files: Vec<PathBuf>,
    pieces: Vec<Piece>,
}

impl Source {
    /// Reads the file and everything that it includes.
    pub(super) fn read(file: &Path) -> Result<Self, SceneError> {
        let mut source = Self { text: String::new(), files: Vec::new(), pieces: Vec::new() };
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        source.inline(file, &folder, None, &mut Vec::new())?;
        Ok(source)
    }

    /// The file and line of a byte of the inlined text.
    pub(super) fn place(&self, offset: usize) -> Place {
        let index = self.pieces.partition_point(|piece| piece.start <= offset).saturating_sub(1);
        let piece = &self.pieces[index];
        let lines = self.text.as_bytes()[piece.start..offset.min(self.text.len())].iter().filter(|b| **b == b'\n');
        Place { file: self.files[piece.file].clone(), line: Some(piece.line + lines.count() as u32) }
    }

    /// Appends the file's text (for an included one: what its root element holds).
    fn inline(
        &mut self,
        file: &Path,
        folder: &Path,
        named_at: Option<&Place>,
        open: &mut Vec<PathBuf>,
    ) -> Result<(), SceneError> {
        let text = std::fs::read_to_string(file).map_err(|error| match named_at {
            Some(place) if error.kind() == std::io::ErrorKind::NotFound => {
                SceneError::MissingFile { place: place.clone(), kind: "include", path: file.to_owned() }
            }
            _ => SceneError::Unreadable {
                file: file.to_owned(),
                reason: error.to_string(),
                expected: "an MJCF scene (UTF-8)".to_owned(),
            },
        })?;
        let identity = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        if let (true, Some(place)) = (open.contains(&identity), named_at) {
            return Err(SceneError::IncludeCycle { place: place.clone(), path: file.to_owned() });
        }
        open.push(identity);
        let at = |line: u32| Place { file: file.to_owned(), line: Some(line) };
        let document = Document::parse(&text)
            .map_err(|error| SceneError::Xml { place: at(error.pos().row), reason: error.to_string() })?;
        let root = document.root_element();
        if named_at.is_none() && root.tag_name().name() != "mujoco" {
            return Err(SceneError::UnknownKey {
                place: at(document.text_pos_at(root.range().start).row),
                kind: "element",
                name: root.tag_name().name().into(),
                parent: "the document".into(),
                nearest: None,
                valid: vec!["mujoco".to_owned()],
            });
        }
        let file_index = self.files.len();
        self.files.push(file.to_owned());
        let kept = match (named_at, root.first_child(), root.last_child()) {
            (None, ..) => 0..text.len(),
            (Some(_), Some(first), Some(last)) => first.range().start..last.range().end,
            _ => 0..0,
        };
        let mut from = kept.start;
        for include in document.descendants().filter(|node| node.has_tag_name("include")) {
            let place = at(document.text_pos_at(include.range().start).row);
            self.push(&text, from..include.range().start, file_index);
            from = include.range().end;
            let name = include.attribute("file").ok_or_else(|| SceneError::BadValue {
                place: place.clone(),
                what: "`file` of <include>".to_owned(),
                value: String::new(),
                expected: "a path".to_owned(),
            })?;
            // MuJoCo looks beside the main file; parts that were written to stand alone mean beside themselves.
            let beside_main = folder.join(name);
            let beside_part = file.parent().map(|own| own.join(name)).filter(|path| path.exists());
            let path = beside_part.filter(|_| !beside_main.exists()).unwrap_or(beside_main);
            self.inline(&path, folder, Some(&place), open)?;
        }
        self.push(&text, from..kept.end, file_index);
        open.pop();
        Ok(())
    }

    fn push(&mut self, text: &str, range: std::ops::Range<usize>, file: usize) {
        let line = 1 + text.as_bytes()[..range.start].iter().filter(|b| **b == b'\n').count() as u32;
        self.pieces.push(Piece { start: self.text.len(), file, line });
        self.text.push_str(&text[range]);
    }
}
