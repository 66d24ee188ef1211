//! Reads recordings of runs, message by message.

use super::image;
use super::run_file::{END, FRAME, FULL, FrameHead, HEAD, LEARNT, MAP, NOTED, PERIOD};
use crate::error::TaskError;
use crate::replay::{End, Entry, EntrySource, Wanted};
use crate::sequence::{decode_color, decode_depth};
use dsm::frame::RgbdFrame;
use dsm::store::StoreError;
use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// A chunk holds what was seen and done in half a second; one longer than this is damage.
const LONGEST_BYTES: usize = 512 << 20;

/// A recording that is being read.
struct RunSource {
    path: PathBuf,
    messages: MessageReader<BufReader<File>>,
    wanted: Wanted,
    /// Images that wait for their frame, by topic.
    images: BTreeMap<String, Vec<u8>>,
    /// The final map, which waits for the end.
    map: Vec<u8>,
    breaks: Option<String>,
    has_ended: bool,
    /// Number of the next message: a reader that skips a damaged record would not tell.
    sequence: u32,
}

/// Opens a recording.
///
/// # Errors
/// [`TaskError::Read`]: it cannot be opened.
pub fn open_run(path: &Path, wanted: Wanted) -> Result<Box<dyn EntrySource>, TaskError> {
    let file = File::open(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
    let options =
        LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LONGEST_BYTES);
    Ok(Box::new(RunSource {
        path: path.to_owned(),
        messages: MessageReader::new_with_options(BufReader::new(file), options),
        wanted,
        images: BTreeMap::new(),
        map: Vec::new(),
        breaks: None,
        has_ended: false,
        sequence: 0,
    }))
}

impl RunSource {
    fn damaged(&self, reason: impl Into<String>) -> TaskError {
        StoreError::Foreign { path: self.path.clone(), expected: "a whole recording", reason: reason.into() }.into()
    }

    fn exact<T: DeserializeOwned>(&self, topic: &str, bytes: &[u8]) -> Result<T, TaskError> {
        postcard::from_bytes(bytes).map_err(|error| self.damaged(format!("{topic}: {error}")))
    }

    fn json<T: DeserializeOwned>(&self, topic: &str, bytes: &[u8]) -> Result<T, TaskError> {
        serde_json::from_slice(bytes).map_err(|error| self.damaged(format!("{topic}: {error}")))
    }

    /// The frame whose images came before its head.
    fn frame(&mut self, head: FrameHead) -> Result<RgbdFrame, TaskError> {
        let mut take = |what: &str| {
            let message = self.images.remove(&format!("/camera/{}/{what}", head.camera));
            message.as_deref().and_then(image::find_png).map(<[u8]>::to_vec)
        };
        let (Some(color), Some(depth)) = (take("color"), take("depth")) else {
            return Err(self.damaged(format!("frame {} has no image", head.id.0)));
        };
        let size = (head.model.width, head.model.height);
        let wrong = |reason: String| self.damaged(format!("frame {}: {reason}", head.id.0));
        let color = decode_color(&color, size).map_err(&wrong)?;
        let depth_m = decode_depth(&depth, size).map_err(&wrong)?;
        Ok(RgbdFrame {
            id: head.id,
            stamp: head.stamp,
            camera: head.camera.into(),
            model: head.model,
            world_from_camera: head.world_from_camera,
            color,
            depth_m,
        })
    }

    /// The entry that a message holds, if it holds one.
    fn find_entry(&mut self, topic: &str, bytes: Vec<u8>) -> Result<Option<Entry>, TaskError> {
        Ok(Some(match topic {
            HEAD => Entry::Head(self.json(topic, &bytes)?),
            PERIOD => Entry::Period(self.exact(topic, &bytes)?),
            LEARNT => Entry::Learnt(self.exact(topic, &bytes)?),
            NOTED => Entry::Noted(self.exact(topic, &bytes)?),
            FULL => Entry::Full(self.exact(topic, &bytes)?),
            FRAME if self.wanted == Wanted::All => {
                let head = self.exact(topic, &bytes)?;
                Entry::Frame(Box::new(self.frame(head)?))
            }
            END => {
                let end: End = self.json(topic, &bytes)?;
                Entry::End(Box::new(End { map: std::mem::take(&mut self.map), ..end }))
            }
            MAP => {
                self.map = bytes;
                return Ok(None);
            }
            _ if self.wanted == Wanted::All && is_image(topic) => {
                self.images.insert(topic.to_owned(), bytes);
                return Ok(None);
            }
            _ => return Ok(None),
        }))
    }
}

fn is_image(topic: &str) -> bool {
    topic.starts_with("/camera/") && (topic.ends_with("/color") || topic.ends_with("/depth"))
}

impl EntrySource for RunSource {
    fn next_entry(&mut self) -> Result<Option<Entry>, TaskError> {
        while let Some(message) = self.messages.next() {
            match message {
                Ok(message) if message.sequence != self.sequence => {
                    return Err(self.damaged(format!("message {} is missing", self.sequence)));
                }
                Ok(message) => {
                    self.sequence = self.sequence.wrapping_add(1);
                    let found = self.find_entry(&message.channel.topic, message.data.into_owned())?;
                    self.has_ended |= matches!(found, Some(Entry::End(_) | Entry::Full(_)));
                    if found.is_some() {
                        return Ok(found);
                    }
                }
                // A process that was killed leaves a file like this; what lies behind the end is only an index.
                Err(McapError::UnexpectedEof) if self.has_ended => return Ok(None),
                Err(McapError::UnexpectedEof) => {
                    self.breaks = Some("the file breaks off".into());
                    return Ok(None);
                }
                Err(error) => return Err(self.damaged(error.to_string())),
            }
        }
        if !self.has_ended {
            self.breaks.get_or_insert_with(|| "the file breaks off".into());
        }
        Ok(None)
    }

    fn find_break(&self) -> Option<String> {
        self.breaks.clone()
    }
}
