//! Queries in the formats in which the data sets are published: ReferIt3D's CSV (Nr3D, Sr3D) and ScanRefer's JSON.

use super::csv::{CsvError, Table};
use super::data::{QueryLine, SceneLine, TargetBox};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// Words that make an expression depend on where the viewer stands, as ReferIt3D counts them.
const VIEW_WORDS: [&str; 10] =
    ["front", "behind", "back", "right", "left", "facing", "leftmost", "rightmost", "looking", "across"];
/// From so many objects of the class on, the target included, a query is hard.
const HARD_FROM: usize = 3;

/// A published file that cannot be read.
#[derive(Debug, Error)]
pub enum PublishedError {
    /// Not CSV, or a column is missing.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// A field of a row does not hold what it should.
    #[error("line {line}: column `{column}` holds {found:?}, expected {expected}")]
    Field {
        /// Line, from 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// What it holds.
        found: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// Not the JSON that ScanRefer publishes.
    #[error("line {line}: {source}", line = source.line())]
    Json {
        /// What is wrong and where.
        #[from]
        source: serde_json::Error,
    },
}

/// Reads `nr3d.csv` or `sr3d.csv`: columns `scan_id`, `target_id`, `utterance`, `instance_type`, and if there
/// `stimulus_id`, `assignmentid`, `dataset`, `mentions_target_class`, `reference_type`.
///
/// As in the published evaluation, rows whose `mentions_target_class` is false are left out. A query is hard when the
/// scene holds more than two objects of its class, by the stimulus or, without one, by the labels of the scene.
///
/// # Errors
/// The first line that does not fit.
pub fn read_referit3d(text: &str, scenes: &BTreeMap<String, SceneLine>) -> Result<Vec<QueryLine>, PublishedError> {
    let table = Table::read(text)?;
    let [scan, target, said, class] =
        ["scan_id", "target_id", "utterance", "instance_type"].map(|name| table.column(name));
    let (scan, target, said, class) = (scan?, target?, said?, class?);
    let [stimulus, assignment, dataset, mentions, kind] =
        ["stimulus_id", "assignmentid", "dataset", "mentions_target_class", "reference_type"]
            .map(|name| table.column(name).ok());
    let mut queries = Vec::new();
    for row in &table.rows {
        let field = |column: Option<usize>| column.map(|column| row.fields[column].trim());
        if field(mentions).is_some_and(|said| said.eq_ignore_ascii_case("false")) {
            continue;
        }
        let id = row.fields[target].trim().parse::<u64>().map_err(|_| PublishedError::Field {
            line: row.line,
            column: "target_id",
            found: row.fields[target].clone(),
            expected: "a whole number",
        })?;
        let scene_id = row.fields[scan].trim().to_owned();
        // scene0525_00-plant-5-9-10-11-12-13: scene, class, count, target, distractors.
        let counted = field(stimulus).and_then(|stimulus| stimulus.rsplit('-').nth_back(2)?.parse::<usize>().ok());
        let same = || count_label(scenes.get(&scene_id), &row.fields[class]);
        let count = counted.or_else(same);
        let name = field(dataset)
            .filter(|name| !name.is_empty())
            .map_or_else(|| if kind.is_some() { "sr3d".to_owned() } else { "nr3d".to_owned() }, str::to_lowercase);
        let number = field(assignment).filter(|id| !id.is_empty()).map_or(row.line.to_string(), str::to_owned);
        queries.push(QueryLine {
            query_id: format!("{name}-{number}"),
            dataset: name,
            scene_id,
            utterance: row.fields[said].clone(),
            target_id: Some(id.into()),
            target_box: None,
            hard: count.map(|count| count >= HARD_FROM),
            unique: None,
            view_dependent: Some(depends_on_view(&row.fields[said])),
            reference_type: field(kind).map(str::to_owned),
        });
    }
    Ok(queries)
}

/// One description of ScanRefer.
#[derive(Deserialize)]
struct Described {
    scene_id: String,
    object_id: Number,
    object_name: String,
    ann_id: Number,
    description: String,
}

/// A number, in quotes or not.
#[derive(Deserialize)]
#[serde(untagged)]
enum Number {
    Whole(u64),
    Text(String),
}

impl Number {
    fn text(&self) -> String {
        match self {
            Self::Whole(number) => number.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

/// Reads `ScanRefer_filtered_val.json` and its like. A description becomes a query over the true boxes of its scene if
/// these are in `scenes`, and one over the detected boxes if there is a scene of this name with `#det` behind it as well.
///
/// # Errors
/// The line that is not the JSON that is expected.
pub fn read_scanrefer(text: &str, scenes: &BTreeMap<String, SceneLine>) -> Result<Vec<QueryLine>, PublishedError> {
    let described: Vec<Described> = serde_json::from_str(text)?;
    let mut queries = Vec::new();
    for one in described {
        let Described { scene_id, object_id, object_name, ann_id, description } = one;
        let id = object_id.text();
        let target = id.parse::<u64>().map_or_else(|_| id.clone().into(), serde_json::Value::from);
        let truth = scenes.get(&scene_id);
        let count = count_label(truth, &object_name);
        let query = QueryLine {
            dataset: "scanrefer_gt".to_owned(),
            query_id: format!("scanrefer-{scene_id}-{id}-{}", ann_id.text()),
            scene_id: scene_id.clone(),
            view_dependent: Some(depends_on_view(&description)),
            utterance: description,
            target_id: Some(target.clone()),
            target_box: None,
            hard: count.map(|count| count >= HARD_FROM),
            unique: count.map(|count| count <= 1),
            reference_type: None,
        };
        let object = truth.and_then(|scene| scene.objects.iter().find(|object| object.id == target));
        let detected = format!("{scene_id}#det");
        if let (Some(object), true) = (object, scenes.contains_key(&detected)) {
            queries.push(QueryLine {
                dataset: "scanrefer_det".to_owned(),
                query_id: format!("{}#det", query.query_id),
                scene_id: detected,
                target_id: None,
                target_box: Some(TargetBox { center: object.center, size: object.size }),
                hard: None,
                ..query.clone()
            });
        }
        queries.push(query);
    }
    Ok(queries)
}

fn count_label(scene: Option<&SceneLine>, class: &str) -> Option<usize> {
    let class = class.trim().replace('_', " ");
    scene.map(|scene| scene.objects.iter().filter(|object| object.label == class).count())
}

fn depends_on_view(text: &str) -> bool {
    let text = text.to_lowercase();
    let words: BTreeSet<&str> = text.split(|c: char| !c.is_alphanumeric()).collect();
    VIEW_WORDS.iter().any(|word| words.contains(word))
}

#[cfg(test)]
mod tests {
    //! Contract: published files give the queries they hold, with splits as their authors count them; a broken line is named.
    use super::super::read_scenes;
    use super::*;

    fn scenes() -> BTreeMap<String, SceneLine> {
        let object = |id: u32, label: &str| {
            format!(
                r#"{{"id": {id}, "label": "{label}", "center": [{id},0,0.4], "size": [1,1,0.8], "mean_rgb": null}}"#
            )
        };
        let objects = [object(0, "trash can"), object(1, "trash can"), object(2, "lamp")].join(",");
        let line = |id: &str| format!(r#"{{"scene_id": "{id}", "objects": [{objects}]}}"#);
        read_scenes(&format!("{}\n{}\n", line("scene0001_00"), line("scene0001_00#det"))).unwrap()
    }

    #[test]
    fn referit3d_rows_become_queries() {
        let csv = "assignmentid,stimulus_id,utterance,scan_id,instance_type,target_id,dataset,mentions_target_class\r\n\
            7,scene0001_00-trash_can-3-1-0-5,\"The one, left of the \"\"big\"\" lamp\",scene0001_00,trash_can,1,nr3d,True\r\n\
            8,,skipped,scene0001_00,lamp,2,nr3d,False\r\n\
            9,,near the lamp,scene0001_00,trash_can,0,nr3d,True\r\n";
        let queries = read_referit3d(csv, &scenes()).unwrap();
        assert_eq!(queries.len(), 2);
        assert_eq!(queries[0].utterance, "The one, left of the \"big\" lamp");
        assert_eq!((queries[0].hard, queries[0].view_dependent), (Some(true), Some(true)));
        assert_eq!(queries[0].target_id, Some(1.into()));
        assert_eq!((queries[1].hard, queries[1].view_dependent), (Some(false), Some(false)));
        assert_eq!(queries[1].query_id, "nr3d-9");
        let broken = csv.replace(",2,nr3d,False", ",x,nr3d,True");
        let error = read_referit3d(&broken, &scenes()).unwrap_err().to_string();
        assert!(error.starts_with("line 3: column `target_id`"), "{error}");
        let error = read_referit3d("a,b\n1,2\n", &scenes()).unwrap_err().to_string();
        assert!(error.contains("scan_id"), "{error}");
    }

    #[test]
    fn scanrefer_descriptions_become_queries_of_both_tiers() {
        let json = r#"[{"scene_id": "scene0001_00", "object_id": "2", "object_name": "lamp", "ann_id": "0",
            "description": "a lamp. it is to the right of the bin.", "token": ["a"]},
            {"scene_id": "scene0001_00", "object_id": "1", "object_name": "trash_can", "ann_id": "3", "description": "a bin"}]"#;
        let queries = read_scanrefer(json, &scenes()).unwrap();
        let names: Vec<&str> = queries.iter().map(|query| query.dataset.as_str()).collect();
        assert_eq!(names, ["scanrefer_det", "scanrefer_gt", "scanrefer_det", "scanrefer_gt"]);
        assert_eq!(queries[0].target_box.unwrap().center, [2.0, 0.0, 0.4]);
        assert_eq!((queries[1].unique, queries[3].unique), (Some(true), Some(false)));
        assert_eq!(queries[1].target_id, Some(2.into()));
        let error = read_scanrefer("[\n{\"scene_id\": 5}]", &scenes()).unwrap_err().to_string();
        assert!(error.starts_with("line 2"), "{error}");
    }
}
