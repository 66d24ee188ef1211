//! `dsm ground MAP TEXT`.

use super::{Output, ResultArgs};
use crate::language::{EMBEDDED, find_language};
use dsm::ground::{GroundConfig, Grounding, GroundingStatus};
use dsm::map::Map;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `dsm ground`.
#[derive(Debug, clap::Args)]
pub struct GroundArgs {
    /// A map file.
    map: PathBuf,
    /// What to find, in English.
    text: String,
    /// Who reads the words and verifies: `embedded`, or a file of models, which needs the feature `models`.
    #[arg(long, value_name = "embedded|FILE", default_value = EMBEDDED)]
    backend: String,
    #[command(flatten)]
    result: ResultArgs,
}

/// Grounds the text; code 0 when found, 1 when absent, ambiguous or not understood.
pub(super) fn run(args: GroundArgs) -> anyhow::Result<u8> {
    let map = super::map::load(&args.map)?;
    let language = find_language(&args.backend)?;
    let grounder = crate::language::grounder(&*language, GroundConfig::default())?;
    let grounding = grounder.ground(&map, &args.text, None);
    Output::new(args.result).give(&grounding, || describe(&grounding, &map))?;
    Ok(u8::from(grounding.status != GroundingStatus::Found))
}

fn describe(grounding: &Grounding, map: &Map) -> String {
    let name = |id| map.find_object(id).map_or("?", |o| o.name());
    let mut text = format!("{:?}", grounding.status).to_lowercase();
    if let Some(id) = grounding.object_id {
        let _ = write!(text, ": object {} ({}), score {:.2}", id.0, name(id), grounding.score);
    }
    if let Some(room) = grounding.room_id.and_then(|id| map.find_room(id)) {
        let _ = write!(text, ": room {} ({}), score {:.2}", room.id.0, room.name, grounding.score);
    }
    let _ = write!(text, "\ndecided by {}", grounding.decided_by);
    for spoken in &grounding.spoken {
        let stage = format!("{:?}", spoken.stage).to_lowercase();
        let _ = write!(text, "\n{stage} by {}", spoken.backend);
        if let Some(reason) = &spoken.reason {
            let _ = write!(text, ": {reason}");
        }
    }
    for candidate in &grounding.candidates {
        let what = match (candidate.object_id, candidate.room_id.and_then(|id| map.find_room(id))) {
            (Some(id), _) => format!("object {} ({})", id.0, name(id)),
            (None, Some(room)) => format!("room {} ({})", room.id.0, room.name),
            (None, None) => "?".into(),
        };
        let _ = write!(text, "\n  {:.2}  {what}", candidate.score);
        for reason in &candidate.reasons {
            let _ = write!(text, "\n        {reason}");
        }
    }
    text
}
