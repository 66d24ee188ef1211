//! `dsm map show|check|export`.

use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::picture::{map_png, map_svg};
use dsm::store::{ExportFormat, ShownMap, export_map, load_map, save_map, show_map, write_atomically};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Scale of a map picture: a flat of ten metres fills a page.
const PIXELS_PER_M: f64 = 64.0;

/// Commands on map files.
#[derive(Debug, clap::Subcommand)]
pub enum MapCommand {
    /// List objects, relations and rooms.
    Show {
        /// A map file.
        map: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Say whether a map file is whole; code 1 when something is lost.
    Check {
        /// A map file.
        map: PathBuf,
        /// Write what can be read to a new map file.
        #[arg(long, value_name = "FILE")]
        repair: Option<PathBuf>,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Write a map in another format.
    Export {
        /// A map file.
        map: PathBuf,
        /// The file to write.
        output: PathBuf,
        /// The format; from the file's ending when left out.
        #[arg(long)]
        format: Option<FormatChoice>,
    },
}

/// Export formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FormatChoice {
    /// Points with colour and instance.
    Ply,
    /// Objects, relations, rooms.
    Json,
    /// Objects.
    Csv,
    /// Nav2 occupancy map (.pgm and .yaml).
    Nav2,
    /// Picture from above, drawn from the measured points.
    Png,
    /// Drawing from above with names.
    Svg,
}

#[derive(Serialize)]
struct Checked {
    whole: bool,
    records: usize,
    lost_bytes: u64,
    loss: Option<String>,
    objects: usize,
    relations: usize,
    rooms: usize,
}

/// Runs a map command.
pub(super) fn run(command: MapCommand) -> anyhow::Result<u8> {
    match command {
        MapCommand::Show { map, result } => {
            let shown = show_map(&load_map(&map).map_err(TaskError::from)?.map);
            Output::new(result).give(&shown, || list(&shown))?;
            Ok(0)
        }
        MapCommand::Check { map, repair, result } => check(&map, repair.as_deref(), result),
        MapCommand::Export { map, output, format } => {
            let format = choose_format(format, &output)?;
            let map = load_map(&map).map_err(TaskError::from)?.map;
            let drawn = |picture: Option<Vec<u8>>| {
                picture.ok_or_else(|| TaskError::Usage("the map is empty: there is nothing to draw".into()))
            };
            let written = match format {
                Format::Export(format) => export_map(&map, format, &output),
                Format::Png => write_atomically(&output, &drawn(map_png(&map, &[], None, PIXELS_PER_M))?),
                Format::Svg => write_atomically(&output, &drawn(map_svg(&map, &[], None).map(String::into_bytes))?),
            };
            written.map_err(TaskError::from)?;
            Ok(0)
        }
    }
}

fn check(path: &Path, repair: Option<&Path>, result: ResultArgs) -> anyhow::Result<u8> {
    let loaded = load_map(path).map_err(TaskError::from)?;
    let checked = Checked {
        whole: loaded.lost_bytes == 0,
        records: loaded.records,
        lost_bytes: loaded.lost_bytes,
        loss: loaded.loss,
        objects: loaded.map.objects.len(),
        relations: loaded.map.relations.len(),
        rooms: loaded.map.rooms.len(),
    };
    if let Some(path) = repair {
        save_map(path, &loaded.map).map_err(TaskError::from)?;
    }
    Output::new(result).give(&checked, || match &checked.loss {
        None => format!("whole: {} records, {} objects", checked.records, checked.objects),
        Some(loss) => format!(
            "{} bytes at the end are lost: {loss}; {} records with {} objects are whole",
            checked.lost_bytes, checked.records, checked.objects
        ),
    })?;
    Ok(u8::from(!checked.whole))
}

/// Where a format is written.
enum Format {
    Export(ExportFormat),
    Png,
    Svg,
}

fn choose_format(choice: Option<FormatChoice>, output: &Path) -> Result<Format, TaskError> {
    let format = match (choice, output.extension().and_then(|e| e.to_str())) {
        (Some(FormatChoice::Png), _) | (None, Some("png")) => return Ok(Format::Png),
        (Some(FormatChoice::Svg), _) | (None, Some("svg")) => return Ok(Format::Svg),
        (Some(FormatChoice::Ply), _) | (None, Some("ply")) => ExportFormat::Ply,
        (Some(FormatChoice::Json), _) | (None, Some("json")) => ExportFormat::Json,
        (Some(FormatChoice::Csv), _) | (None, Some("csv")) => ExportFormat::Csv,
        (Some(FormatChoice::Nav2), _) | (None, Some("pgm")) => ExportFormat::Nav2,
        (None, _) => {
            let name = output.display();
            let expected = "expected .ply, .json, .csv, .pgm, .png or .svg, or --format";
            return Err(TaskError::Usage(format!("{name}: {expected}")));
        }
    };
    Ok(Format::Export(format))
}

fn list(shown: &ShownMap) -> String {
    let mut text = String::new();
    for o in &shown.objects {
        let [x, y, z] = o.center;
        let word = |value: Option<&String>| value.cloned().unwrap_or_default();
        let color = word(o.attributes.appearance.get("color"));
        let material = word(o.attributes.physical.get("material"));
        let room = o.room.as_deref().unwrap_or("-");
        let _ = writeln!(
            text,
            "{:>4}  {:<18} {color:<8} {material:<9} ({x:6.2}, {y:6.2}, {z:5.2})  {room:<12} seen {}",
            o.id, o.name, o.observations
        );
    }
    let _ = writeln!(
        text,
        "{} objects, {} relations, {} rooms",
        shown.objects.len(),
        shown.relations.len(),
        shown.rooms.len()
    );
    text
}
