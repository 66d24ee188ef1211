//! Contract: what a network is given and what becomes of what it gives is what an independent implementation in numpy
//! says (`networks/make.py`), for networks of the true inputs and outputs of YOLO-World, SAM 2, DINOv2, SigLIP, CLIP and
//! MiniLM; a file that is not the right one says so when it is opened.

#![cfg(feature = "onnx")]
#![allow(clippy::unwrap_used, reason = "a test that cannot read its files fails")]

use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::perceive::{Detector, ObjectView, TextEncoder, VisualEncoder, cosine};
use dsm::time::Stamp;
use dsm_models::onnx::{
    ClipText, Dinov2, Letterbox, MiniLm, Rgb, Sam2, SiglipImage, SiglipText, YoloWorld, canonical, open_detector, probe,
};
use dsm_models::wall::SystemWall;
use dsm_models::{
    Answers, Client, DetectorSettings, LanguageSettings, ModelError, ModelSettings, NetworkFile, Reply,
    SegmenterSettings, Transport,
};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks")
}

fn golden() -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder().join("golden.json")).unwrap()).unwrap()
}

fn file(name: &str) -> NetworkFile {
    let (source, licence) = ("make.py".into(), "MIT OR Apache-2.0".into());
    NetworkFile { file: folder().join(name), sha256: None, source, licence }
}

fn detector(network: &str) -> DetectorSettings {
    DetectorSettings {
        network: file(network),
        text: file("clip_text.onnx"),
        tokenizer: file("clip.tokenizer.json"),
        vocabulary: vec!["red apple".into(), "mug".into()],
        least_score: 0.55,
        overlap: 0.2,
        most: 12,
        tags_every_s: 5.0,
        most_tags: 60,
    }
}

fn segmenter() -> SegmenterSettings {
    SegmenterSettings { encoder: file("sam2_encoder.onnx"), decoder: file("sam2_decoder.onnx"), least_iou: 0.5 }
}

/// The picture of `make.py`.
fn picture(width: u32, height: u32) -> Rgb {
    let pixel = |index: u32| {
        let (x, y) = (index % width, index / width);
        let red = x * 255 / (width - 1).max(1);
        let green = y * 255 / (height - 1).max(1);
        let blue = (x / 16 + y / 16) % 2 * 180 + x * y % 64;
        [red as u8, green as u8, blue as u8]
    };
    Rgb { width, height, color: (0..width * height).map(pixel).collect() }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn size_of(value: &Value) -> (u32, u32) {
    let size = numbers(&value["size"]);
    (size[0] as u32, size[1] as u32)
}

/// Values at the sampled places are the golden ones.
fn check(what: &str, values: &[f32], sampled: &Value, tolerance: f64) {
    assert_eq!(values.len() as u64, sampled["length"].as_u64().unwrap(), "{what}");
    for (place, expected) in numbers(&sampled["places"]).into_iter().zip(numbers(&sampled["values"])) {
        let value = f64::from(values[place as usize]);
        assert!((value - expected).abs() <= tolerance, "{what}: value {place} is {value}, expected {expected}");
    }
}

#[test]
fn pictures_are_prepared_as_the_networks_were_trained_with() {
    // One step of 8 bits in a picture that is resized, over the smallest deviation.
    let step = 1.001 / 255.0;
    for one in golden()["prepared"].as_array().unwrap() {
        let (width, height) = size_of(one);
        let picture = picture(width, height);
        let (letterbox, square) = Letterbox::of(&picture, 640);
        let told = &one["letterbox"];
        assert!((letterbox.scale - told["scale"].as_f64().unwrap()).abs() < 1e-12);
        assert_eq!(u64::from(letterbox.left), told["left"].as_u64().unwrap());
        assert_eq!(u64::from(letterbox.top), told["top"].as_u64().unwrap());
        let bytes: Vec<f32> = square.color.as_flattened().iter().map(|byte| f32::from(*byte)).collect();
        check("letterbox", &bytes, &told["pixels"], 1.0);
        check("sam2", &Sam2::prepare(&picture, 1024), &one["sam2"], step / 0.224);
        check("dinov2", &Dinov2::prepare(&picture), &one["dinov2"], step / 0.224);
        check("siglip", &SiglipImage::prepare(&picture), &one["siglip"], step / 0.5);
        // A box of the square and back.
        let (x, y) = (f64::from(letterbox.left), f64::from(letterbox.top));
        let corners = [0.25, 0.5, 0.75, 1.0].map(|part: f64| part * f64::from(width.min(height)) * letterbox.scale);
        let corners = [corners[0] + x, corners[1] + y, corners[2] + x, corners[3] + y].map(|v| v as f32);
        let undone = letterbox.undo(corners, (width, height));
        for (value, part) in undone.iter().zip([0.25, 0.5, 0.75, 1.0]) {
            assert!((f64::from(*value) - part * f64::from(width.min(height))).abs() < 1e-2, "{undone:?}");
        }
    }
}

#[test]
fn words_become_features() {
    let golden = golden();
    let clip = ClipText::open(&file("clip_text.onnx"), &file("clip.tokenizer.json")).unwrap();
    for one in golden["clip"].as_array().unwrap() {
        check("clip", &clip.feature(one["text"].as_str().unwrap()).unwrap(), &one["feature"], 2e-4);
    }
    let siglip = SiglipText::open(&file("siglip_text.onnx"), &file("siglip.tokenizer.json")).unwrap();
    for one in golden["siglip_text"].as_array().unwrap() {
        let text = one["text"].as_str().unwrap();
        assert_eq!(canonical(text), one["canonical"].as_str().unwrap());
        check("siglip", &siglip.feature(text).unwrap(), &one["feature"], 2e-4);
    }
    let label = TextEncoder::encode(&siglip, "white shelf");
    check("siglip label", &label, &golden["siglip_text"][1]["feature"], 2e-4);
    let minilm = MiniLm::open(&file("minilm.onnx"), &file("minilm.tokenizer.json")).unwrap();
    for one in golden["minilm"].as_array().unwrap() {
        let text = one["text"].as_str().unwrap();
        check("minilm", &minilm.feature(text).unwrap(), &one["feature"], 2e-4);
        assert_eq!(TextEncoder::encode(&minilm, text), minilm.feature(text).unwrap(), "remembered or not");
    }
}

#[test]
fn pictures_become_features() {
    let golden = golden();
    let picture = picture(320, 200);
    let dinov2 = Dinov2::open(&file("dinov2.onnx")).unwrap();
    check("dinov2", &dinov2.feature(&picture).unwrap(), &golden["dinov2"], 1e-4);
    let siglip = SiglipImage::open(&file("siglip_image.onnx")).unwrap();
    check("siglip", &siglip.feature(&picture).unwrap(), &golden["siglip_image"], 1e-4);
    // A view is the square around its pixels, also at the border of the frame.
    let frame = frame(320, 200);
    let pixels: Vec<u32> = (0..60).flat_map(|row| (0..40).map(move |column| row * 320 + column)).collect();
    let view = ObjectView { frame: &frame, pixels: &pixels, name: "mug", extent_m: nalgebra::Vector3::repeat(0.1) };
    for feature in [dinov2.encode(&view), siglip.encode(&view)] {
        assert!((cosine(&feature, &feature) - 1.0).abs() < 1e-4);
    }
    let nothing = ObjectView { pixels: &[], ..view };
    assert!(dinov2.encode(&nothing).iter().all(|value| *value == 0.0), "nothing to see is like nothing");
}

#[test]
fn boxes_are_found_by_names() {
    let names = ["red apple", "mug", "white shelf", "blue table", "red mug"].map(str::to_owned);
    for (network, key) in [("yolo_world.onnx", "together"), ("yolo_world_columns.onnx", "in_parts")] {
        let finder = YoloWorld::open(&detector(network)).unwrap();
        for one in golden()["boxes"].as_array().unwrap() {
            let (width, height) = size_of(one);
            let found = finder.find(&picture(width, height), &names).unwrap();
            let expected = one[key].as_array().unwrap();
            let count = (found.len(), expected.len());
            assert_eq!(count.0, count.1, "{network} {width}x{height}");
            assert!(count.0 >= 3, "the pictures show something");
            for (one, expected) in found.iter().zip(expected) {
                assert_eq!(one.name as u64, expected["name"].as_u64().unwrap(), "{network} {width}x{height}");
                assert!((f64::from(one.score) - expected["score"].as_f64().unwrap()).abs() < 2e-3);
                for (corner, told) in one.corners.iter().zip(numbers(&expected["corners"])) {
                    assert!((f64::from(*corner) - told).abs() < 1e-3, "{network}: {one:?}, expected {expected}");
                }
            }
        }
        assert!(finder.find(&picture(64, 48), &[]).unwrap().is_empty(), "who looks for nothing finds nothing");
    }
}

#[test]
fn boxes_are_cut_out() {
    let sam2 = Sam2::open(&segmenter()).unwrap();
    for one in golden()["masks"].as_array().unwrap() {
        let (width, height) = size_of(one);
        let embedded = sam2.embed(&picture(width, height)).unwrap();
        let corners: Vec<f32> = numbers(&one["corners"]).into_iter().map(|value| value as f32).collect();
        let (mask, expected) = sam2.cut_out(&embedded, corners.try_into().unwrap()).unwrap();
        assert!((f64::from(expected) - one["expected"].as_f64().unwrap()).abs() < 1e-5);
        // Places whose logit is almost 0 may fall on either side.
        let area = one["area"].as_f64().unwrap();
        assert!((mask.area() as f64 - area).abs() <= 2.0 + 0.002 * area, "{} of {area} pixels", mask.area());
        assert!(mask.area() > 100, "the boxes hold something");
        let edges: Vec<f64> =
            mask.runs.iter().flat_map(|run| [run.start, run.start + run.length]).map(f64::from).collect();
        let wrong = edges.iter().zip(numbers(&one["edges"])).filter(|(edge, told)| (**edge - told).abs() > 1.0).count();
        assert!(wrong <= 1, "{:?}, expected {}", &edges[..8.min(edges.len())], one["edges"]);
    }
}

fn frame(width: u32, height: u32) -> RgbdFrame {
    RgbdFrame {
        id: FrameId(3),
        stamp: Stamp::default(),
        camera: "head".into(),
        model: dsm::camera::CameraModel::from_vertical_fov(width, height, 0.9),
        world_from_camera: dsm::Pose::identity(),
        color: picture(width, height).color,
        depth_m: vec![1.5; (width * height) as usize],
    }
}

fn settings(detector: Option<DetectorSettings>) -> ModelSettings {
    ModelSettings {
        version: 1,
        language: None,
        detector,
        segmenter: Some(segmenter()),
        visual: None,
        text: None,
        sight: Default::default(),
    }
}

#[test]
fn detections_are_named_boxes_with_masks() {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let settings = settings(Some(detector("yolo_world.onnx")));
    let mut sight = open_detector(&settings, None, &knowledge).unwrap().unwrap();
    let frame = frame(320, 200);
    let seen = sight.detect(&frame);
    assert!(sight.failure().is_none() && seen.frame == frame.id && !seen.items.is_empty());
    for item in &seen.items {
        assert!(["red apple", "mug"].contains(&item.name.as_str()) && item.score >= 0.55);
        assert!(item.mask.image_width == 320 && item.mask.area() > 0);
        assert!(item.mask.pixels().all(|pixel| pixel < 320 * 200));
    }
    assert_eq!(sight.detect(&frame), seen, "the same frame shows the same");
    // Frames without pixels show nothing.
    let empty = RgbdFrame { color: Vec::new(), ..frame };
    assert!(sight.detect(&empty).items.is_empty());
}

/// A model that names the same things in every picture.
struct Names;

impl Transport for Names {
    fn post(&self, _: &str, _: f64) -> Result<Reply, ModelError> {
        let answer = json!({"thought": "", "answer": {"things": ["Red mug", "open the gripper", "mug"]}}).to_string();
        let body = json!({"choices": [{"message": {"content": answer}, "finish_reason": "stop"}]});
        Ok(Reply { status: 200, retry_after_s: None, body: body.to_string().into() })
    }
}

#[test]
fn what_a_language_model_names_is_looked_for() {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let settings = settings(Some(detector("yolo_world.onnx")));
    let folder = tempfile::tempdir().unwrap();
    let cache = Some(folder.path().to_owned());
    let client = |answers| {
        let language =
            LanguageSettings { cache: cache.clone(), answers, ..LanguageSettings::new("http://127.0.0.1:9/v1", "m") };
        Arc::new(Client::with_transport(language, None, Box::new(Names), Box::new(SystemWall::new())).unwrap())
    };
    let seen_by = |sight: &mut dyn Detector, number: u64| {
        let stamp = Stamp::from_s(6.0 * number as f64);
        let seen = sight.detect(&RgbdFrame { id: FrameId(number), stamp, ..frame(320, 200) });
        seen.items.into_iter().map(|item| item.name).collect::<BTreeSet<String>>()
    };
    // Nobody waits for the model: its names come with a later frame.
    let mut sight = open_detector(&settings, Some(client(Answers::Live)), &knowledge).unwrap().unwrap();
    let all = (0..40).map(|number| seen_by(&mut sight, number)).find(|names| names.contains("red mug"));
    let all = all.expect("its names are looked for");
    let wanted = ["red apple", "mug", "red mug"];
    assert!(all.iter().all(|name| wanted.contains(&name.as_str())), "{all:?}");
    // What is cached is there at once, and without a server; without the use nothing is asked.
    let mut cached = open_detector(&settings, Some(client(Answers::Cached)), &knowledge).unwrap().unwrap();
    assert_eq!(seen_by(&mut cached, 0), all);
    let mut plain = open_detector(&settings, None, &knowledge).unwrap().unwrap();
    assert!(!seen_by(&mut plain, 0).contains("red mug"));
}

#[test]
fn a_probe_tells_of_every_part() {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let mut settings = settings(Some(detector("yolo_world.onnx")));
    let text: Value =
        json!({"kind": "minilm", "network": file("minilm.onnx"), "tokenizer": file("minilm.tokenizer.json")});
    settings.text = Some(serde_json::from_value(text).unwrap());
    settings.visual = Some(serde_json::from_value(json!({"kind": "siglip", "network": file("dinov2.onnx")})).unwrap());
    let probes = probe(&settings, &knowledge);
    let told: Vec<_> = probes.iter().map(|probe| (probe.part, probe.passed)).collect();
    assert_eq!(told, [("detector", true), ("visual", false), ("text", true)], "{probes:?}");
    assert!(
        probes[1].found.contains("dinov2.onnx") && probes[1].found.contains("pooler_output"),
        "{}",
        probes[1].found
    );
}

#[test]
fn what_is_no_such_network_says_so() {
    let told = |error: dsm_models::onnx::NetworkError| error.to_string();
    // Another network, other shapes, no network, another file, none.
    let error = told(YoloWorld::open(&detector("dinov2.onnx")).err().unwrap());
    assert!(error.contains("dinov2.onnx: there is no input images; it has pixel_values"), "{error}");
    let error = told(Dinov2::open(&file("siglip_image.onnx")).err().unwrap());
    assert!(error.contains("last_hidden_state is f32 [batch, 196, 768], expected f32 [any, 257, any]"), "{error}");
    let error = told(SiglipText::open(&file("clip_text.onnx"), &file("siglip.tokenizer.json")).err().unwrap());
    assert!(error.contains("there is no output pooler_output; it has text_embeds"), "{error}");
    let error = told(SiglipText::open(&file("minilm.onnx"), &file("siglip.tokenizer.json")).err().unwrap());
    assert!(error.contains("there is no output pooler_output"), "{error}");
    let error = told(MiniLm::open(&file("golden.json"), &file("minilm.tokenizer.json")).err().unwrap());
    assert!(error.contains("golden.json: no ONNX network that can be run"), "{error}");
    let error = told(MiniLm::open(&file("minilm.onnx"), &file("minilm.onnx")).err().unwrap());
    assert!(error.contains("minilm.onnx: no tokenizer"), "{error}");
    let error = told(ClipText::open(&file("clip_text.onnx"), &file("minilm.tokenizer.json")).err().unwrap());
    assert!(error.contains("<|endoftext|>"), "{error}");
    let error = told(MiniLm::open(&file("absent.onnx"), &file("minilm.tokenizer.json")).err().unwrap());
    assert!(error.contains("absent.onnx") && error.contains("make.py"), "{error}");
    let other = NetworkFile { sha256: Some("0".repeat(64)), ..file("minilm.onnx") };
    let error = told(MiniLm::open(&other, &file("minilm.tokenizer.json")).err().unwrap());
    assert!(error.contains("its SHA-256 is") && error.contains("expected 0000"), "{error}");
}
