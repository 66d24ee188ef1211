//! Which networks see, cut out and encode: the parts of a file of models beside the language model. They are read and
//! checked whether or not the program can run networks (feature `onnx`).

use crate::settings::SettingsError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A file of a network, and where it is from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// The file, relative to the file of models.
    pub file: PathBuf,
    /// SHA-256 of its bytes, 64 hexadecimal digits. Without it nothing tells whether the file is the right one: `dsm models
    /// check` prints the one that is there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Where it is from: an address that `dsm models fetch` gets it from, or words on how to make it.
    pub source: String,
    /// Under which licence it may be used.
    pub licence: String,
}

/// YOLO-World: boxes of things by their names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DetectorSettings {
    /// The detector: `images` and `text_features` in, `scores` and `boxes`, or `output0`, out.
    pub network: NetworkFile,
    /// CLIP's text encoder: `input_ids` in, `text_embeds` out.
    pub text: NetworkFile,
    /// CLIP's tokenizer, `tokenizer.json`.
    pub tokenizer: NetworkFile,
    /// What is looked for. Default: the names of the knowledge table. With the use `tags` of a language model, what it
    /// names is looked for too.
    #[serde(default)]
    pub vocabulary: Vec<String>,
    /// Least score of a detection. Default 0.25, as map construction asks; range 0.01 to 1.
    #[serde(default = "default_least_score")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub least_score: f32,
    /// Overlap, intersection over union, from which the less sure of two boxes is left out, whatever their names. Default
    /// 0.6, range 0.05 to 1.
    #[serde(default = "default_overlap")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub overlap: f32,
    /// Detections in one frame at most. Default 60, range 1 to 300.
    #[serde(default = "default_most")]
    #[schemars(range(min = 1, max = 300))]
    pub most: u32,
    /// Time between two frames of which the language model tells the tags, seconds. Default 5, range 0.1 to 600.
    #[serde(default = "default_tags_every_s")]
    #[schemars(range(min = 0.1, max = 600.0))]
    pub tags_every_s: f64,
    /// Names from tags that are looked for at a time; the oldest go. Default 60, range 0 to 300.
    #[serde(default = "default_most_tags")]
    #[schemars(range(min = 0, max = 300))]
    pub most_tags: u32,
}

/// SAM 2: the mask of what lies in a box. Without a detector the boxes are those of the embedded segmenter, without names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SegmenterSettings {
    /// The image encoder: `image` in; `high_res_feats_0`, `high_res_feats_1` and `image_embed` out.
    pub encoder: NetworkFile,
    /// Prompt encoder and mask decoder: these with `point_coords`, `point_labels`, `mask_input` and `has_mask_input` in;
    /// `masks` and `iou_predictions` out.
    pub decoder: NetworkFile,
    /// Least predicted overlap of a mask with the thing. Default 0.5, range 0 to 1.
    #[serde(default = "default_least_iou")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub least_iou: f32,
}

/// Networks for visual features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum VisualKind {
    /// DINOv2: the class token of the last layer.
    Dinov2,
    /// SigLIP's image tower.
    Siglip,
}

/// A visual encoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VisualSettings {
    /// Which one.
    pub kind: VisualKind,
    /// The network: `pixel_values` in, `last_hidden_state` (DINOv2) or `pooler_output` (SigLIP) out.
    pub network: NetworkFile,
}

/// Networks for text features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TextKind {
    /// MiniLM: the mean over the words of a sentence encoder.
    Minilm,
    /// SigLIP's text tower.
    Siglip,
}

/// A text encoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextSettings {
    /// Which one.
    pub kind: TextKind,
    /// The network: `input_ids` in, `last_hidden_state` (MiniLM) or `pooler_output` (SigLIP) out.
    pub network: NetworkFile,
    /// Its `tokenizer.json`.
    pub tokenizer: NetworkFile,
}

/// How frames are taken up by a slow detector. Seconds are those of the frames' stamps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SightSettings {
    /// Time between two frames in which things are looked for, seconds. Default 0.5, range 0 to 600.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub every_s: f64,
    /// Frames that are looked at in one run. Default 100000, range 0 to 10000000.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub most_frames: u32,
    /// Frames under way at a time; further ones only tell of free space. Default 2, range 1 to 16.
    #[schemars(range(min = 1, max = 16))]
    pub most_pending: u32,
    /// What a frame showed is taken in at its stamp plus this, seconds, however fast the machine is. Default 1, range 0 to
    /// 600.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub latency_s: f64,
    /// What happens when that moment has come and the detector is not ready. Default `late`.
    pub pace: Pace,
}

/// What happens when the declared moment has come and a detector is not ready.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// Nothing waits: the frame counts when the detector is ready. Runs then depend on the speed of the machine.
    #[default]
    Late,
    /// A world that can wait does: the same run on every machine. For simulation alone.
    Lockstep,
}

impl Default for SightSettings {
    fn default() -> Self {
        Self { every_s: 0.5, most_frames: 100_000, most_pending: 2, latency_s: 1.0, pace: Pace::default() }
    }
}

impl NetworkFile {
    pub(crate) fn check(&self, models: &Path, key: &'static str) -> Result<(), SettingsError> {
        let wrong = |value: &str, expected: &'static str| {
            Err(SettingsError::Value { file: models.to_owned(), key, value: value.to_owned(), expected })
        };
        if self.file.as_os_str().is_empty() {
            return wrong("", "a file name");
        }
        let digest =
            |text: &str| text.len() == 64 && text.chars().all(|c| c.is_ascii_digit() || ('a'..='f').contains(&c));
        match &self.sha256 {
            Some(sum) if !digest(sum) => wrong(sum, "64 hexadecimal digits in lower case as sha256"),
            _ if self.licence.trim().is_empty() => wrong("", "the name of its licence"),
            _ => Ok(()),
        }
    }

    /// The address to get it from; `None` when its source is words.
    pub fn find_address(&self) -> Option<&str> {
        let plain = self.source.chars().all(|c| c.is_ascii_graphic());
        let is_address = plain && (self.source.starts_with("https://") || self.source.starts_with("http://"));
        is_address.then_some(self.source.as_str())
    }
}

fn default_least_score() -> f32 {
    0.25
}

fn default_overlap() -> f32 {
    0.6
}

fn default_most() -> u32 {
    60
}

fn default_tags_every_s() -> f64 {
    5.0
}

fn default_most_tags() -> u32 {
    60
}

fn default_least_iou() -> f32 {
    0.5
}
