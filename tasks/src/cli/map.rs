//! `dsm map show|check|export|import|merge`.

use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::picture::{map_png, map_svg};
use dsm::Pose;
use dsm::build::BuildConfig;
use dsm::map::Map;
use dsm::store::{
    ExportFormat, FORMAT_VERSION, Lost, Merged, ShownMap, export_map, import_spark_dsg, load_map, merge_maps, save_map,
    show_map, write_atomically,
};
use nalgebra::{Translation3, UnitQuaternion};
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
        #[arg(required_unless_present = "out", conflicts_with = "out")]
        output: Option<PathBuf>,
        /// The file to write.
        #[arg(short, long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// The format; from the file's ending when left out.
        #[arg(long)]
        format: Option<FormatChoice>,
    },
    /// Make a map of a scene graph that spark_dsg (Hydra) wrote as JSON.
    Import {
        /// The scene graph.
        file: PathBuf,
        /// The map file to write.
        #[arg(short, long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Put two maps of one place into one.
    Merge {
        /// A map file; its world and its identities stay.
        map: PathBuf,
        /// The map file that is put into it.
        other: PathBuf,
        /// Where the other map's world lies in the first one's: metres and radians (about z).
        #[arg(long, value_name = "X,Y,Z,YAW", value_parser = parse_transform, allow_hyphen_values = true)]
        transform: Pose,
        /// The map file to write.
        #[arg(short, long, value_name = "FILE")]
        out: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
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
    /// glTF 2.0, binary (.glb).
    Gltf,
    /// Scene graph for spark_dsg (JSON).
    SparkDsg,
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
    version: String,
    finished: bool,
    records: usize,
    missing_records: u64,
    unknown_records: usize,
    lost_bytes: u64,
    lost: Vec<LostBytes>,
    loss: Option<String>,
    objects: usize,
    relations: usize,
    rooms: usize,
}

#[derive(Serialize)]
struct LostBytes {
    from: u64,
    to: u64,
    reason: String,
}

/// Runs a map command.
pub(super) fn run(command: MapCommand) -> anyhow::Result<u8> {
    match command {
        MapCommand::Show { map, result } => {
            let shown = show_map(&load(&map)?);
            Output::new(result).give(&shown, || list(&shown))?;
            Ok(0)
        }
        MapCommand::Check { map, repair, result } => check(&map, repair.as_deref(), result),
        MapCommand::Import { file, out } => {
            let map = import_spark_dsg(&file).map_err(TaskError::from)?;
            save_map(&out, &map).map_err(TaskError::from)?;
            Ok(0)
        }
        MapCommand::Merge { map, other, transform, out, result } => merge([&map, &other], &transform, &out, result),
        MapCommand::Export { map, output, out, format } => {
            // One of the two is there, or the flags are refused.
            let output = output.or(out).unwrap_or_default();
            let format = choose_format(format, &output)?;
            let map = load(&map)?;
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

/// The map in a file; what of it is lost is said on stderr.
pub(super) fn load(path: &Path) -> Result<Map, TaskError> {
    let loaded = load_map(path)?;
    if let Some(loss) = &loaded.loss {
        tracing::warn!("{}: {loss}", path.display());
    }
    Ok(loaded.map)
}

#[derive(Serialize)]
struct MergedMap {
    objects: usize,
    #[serde(flatten)]
    merged: Merged,
}

fn merge(maps: [&Path; 2], transform: &Pose, out: &Path, result: ResultArgs) -> anyhow::Result<u8> {
    let [map, other] = [load(maps[0])?, load(maps[1])?];
    let knowledge = crate::assemble::knowledge()?;
    let (map, merged) = merge_maps(&map, &other, transform, &BuildConfig::default(), &knowledge);
    save_map(out, &map).map_err(TaskError::from)?;
    let merged = MergedMap { objects: map.objects.len(), merged };
    Output::new(result).give(&merged, || {
        let Merged { in_both, added, rooms_in_both, rooms_added } = merged.merged;
        format!(
            "{} objects: {in_both} in both maps, {added} added; {rooms_in_both} rooms in both, {rooms_added} added",
            merged.objects
        )
    })?;
    Ok(0)
}

/// `X,Y,Z,YAW` in metres and radians.
fn parse_transform(text: &str) -> Result<Pose, String> {
    let values: Vec<f64> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    match values[..] {
        [x, y, z, yaw] if values.iter().all(|v| v.is_finite()) && text.split(',').count() == 4 => {
            Ok(Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(0.0, 0.0, yaw)))
        }
        _ => Err("expected four numbers x,y,z,yaw in metres and radians, for example 1.5,0,0,3.14".into()),
    }
}

fn check(path: &Path, repair: Option<&Path>, result: ResultArgs) -> anyhow::Result<u8> {
    let loaded = load_map(path).map_err(TaskError::from)?;
    let checked = Checked {
        whole: loaded.loss.is_none(),
        version: format!("{FORMAT_VERSION}.{}", loaded.minor_version),
        finished: loaded.finished,
        records: loaded.records,
        missing_records: loaded.missing_records,
        unknown_records: loaded.unknown_records,
        lost_bytes: loaded.lost_bytes,
        lost: loaded.lost.into_iter().map(|Lost { from, to, reason }| LostBytes { from, to, reason }).collect(),
        loss: loaded.loss,
        objects: loaded.map.objects.len(),
        relations: loaded.map.relations.len(),
        rooms: loaded.map.rooms.len(),
    };
    if let Some(path) = repair {
        save_map(path, &loaded.map).map_err(TaskError::from)?;
    }
    Output::new(result).give(&checked, || match &checked.loss {
        None => format!(
            "whole: {} records, {} objects{}",
            checked.records,
            checked.objects,
            if checked.finished { "" } else { "; the log of a run that goes on or broke off" }
        ),
        Some(loss) => format!(
            "{loss}; {} records with {} objects are whole. An object whose last record is lost is missing or as it was \
             before; one that was removed in a lost record is still there",
            checked.records, checked.objects
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
        (Some(FormatChoice::Gltf), _) | (None, Some("glb")) => ExportFormat::Gltf,
        (Some(FormatChoice::SparkDsg), _) => ExportFormat::SparkDsg,
        (Some(FormatChoice::Nav2), _) | (None, Some("pgm" | "yaml")) => ExportFormat::Nav2,
        (None, _) => {
            let name = output.display();
            let expected = "expected .ply, .json, .csv, .glb, .pgm, .yaml, .png or .svg, or --format";
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
