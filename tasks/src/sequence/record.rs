//! Writes what a map is made of while it is made.

use super::{DetectionsLine, FrameLine, Head, VERSION};
use crate::error::TaskError;
use crate::perception::{Tape, Taped};
use crate::picture::{color_png, depth_mm_png};
use dsm::map::Map;
use dsm::store::{StoreError, write_atomically};
use serde::Serialize;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Records a sequence into a folder.
pub struct SequenceRecorder {
    folder: PathBuf,
    frames: BufWriter<File>,
    detections: BufWriter<File>,
    exact_depth: bool,
}

impl SequenceRecorder {
    /// Begins a sequence in a folder that exists. `source` says in words what is recorded; with `exact_depth` depth is also
    /// kept as measured, for it is rounded to millimetres in the images.
    ///
    /// # Errors
    /// [`TaskError::Store`]: something cannot be written.
    pub fn begin(folder: &Path, source: &str, exact_depth: bool) -> Result<Self, TaskError> {
        let io = |path: PathBuf| move |source| StoreError::Io { path, source };
        for name in ["color", "depth"] {
            let path = folder.join(name);
            std::fs::create_dir_all(&path).map_err(io(path))?;
        }
        let head = Head { version: VERSION, source: source.into(), depth_unit_mm: 1.0, exact_depth };
        let text = serde_json::to_string_pretty(&head).map_err(|e| TaskError::Internal(e.to_string()))?;
        write_atomically(&folder.join("sequence.json"), text.as_bytes())?;
        let open = |name: &str| {
            let path = folder.join(name);
            File::create(&path).map(BufWriter::new).map_err(io(path))
        };
        Ok(Self {
            frames: open("frames.jsonl")?,
            detections: open("detections.jsonl")?,
            folder: folder.to_owned(),
            exact_depth,
        })
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let path = self.folder.join(name);
        std::fs::write(&path, bytes).map_err(|source| StoreError::Io { path, source })
    }
}

fn write_line<T: Serialize>(file: &mut BufWriter<File>, path: PathBuf, line: &T) -> Result<(), StoreError> {
    let written = serde_json::to_writer(&mut *file, line).map_err(std::io::Error::from);
    written.and_then(|()| file.write_all(b"\n")).map_err(|source| StoreError::Io { path, source })
}

impl Tape for SequenceRecorder {
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError> {
        let Taped { frame, detections, detector, carrier, .. } = taped;
        let number = format!("{:06}", frame.id.0);
        let line = FrameLine {
            id: frame.id,
            stamp: frame.stamp,
            camera: frame.camera.to_string(),
            model: frame.model,
            world_from_camera: frame.world_from_camera,
            color: format!("color/{number}.png"),
            depth: format!("depth/{number}.png"),
            exact_depth: self.exact_depth.then(|| format!("depth/{number}.f32")),
            carrier: (*carrier).into(),
        };
        self.write(&line.color, &color_png(frame))?;
        self.write(&line.depth, &depth_mm_png(frame))?;
        if let Some(name) = &line.exact_depth {
            let bytes: Vec<u8> = frame.depth_m.iter().flat_map(|depth| depth.to_le_bytes()).collect();
            self.write(name, &bytes)?;
        }
        let items = detections.items.iter().map(Into::into).collect();
        let found = DetectionsLine { frame: detections.frame, detector: (*detector).to_owned(), items };
        write_line(&mut self.detections, self.folder.join("detections.jsonl"), &found)?;
        // A frame is listed when all of it is there.
        write_line(&mut self.frames, self.folder.join("frames.jsonl"), &line)
    }

    fn finish(mut self: Box<Self>, _: &Map) -> Result<(), StoreError> {
        let flushed = self.frames.flush().and_then(|()| self.detections.flush());
        flushed.map_err(|source| StoreError::Io { path: self.folder.join("frames.jsonl"), source })
    }
}
