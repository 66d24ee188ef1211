//! What the wire carries: 640 x 480 colour and depth at 10 Hz and joint states at 100 Hz, from one process to another.
//!
//! ```sh
//! cargo run --release -p dsm-ros2 --example wire -- hear reliable 20 &
//! cargo run --release -p dsm-ros2 --example wire -- say reliable 20
//! ```
#![allow(
    missing_docs,
    clippy::print_stdout,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "a program that measures time"
)]

use dsm::time::Stamp;
use dsm_ros2::link::{Delivery, LinkBuilder};
use dsm_ros2::messages::{Header, Image, JointState};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

const DOMAIN: u16 = 73;

fn now() -> Stamp {
    Stamp(SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as i64)
}

/// Processor time of this process, seconds.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

fn image(encoding: &str, bytes: u32, fill: u8) -> Image {
    Image {
        header: Header::new(now(), "head"),
        height: 480,
        width: 640,
        encoding: encoding.into(),
        is_bigendian: 0,
        step: 640 * bytes,
        data: vec![fill; (640 * 480 * bytes) as usize],
    }
}

fn say(delivery: Delivery, seconds: f64) {
    let mut link = LinkBuilder::<()>::new("wire_speaker", DOMAIN).unwrap();
    let mut color = link.speak::<Image>("/wire/color", delivery).unwrap();
    let mut depth = link.speak::<Image>("/wire/depth", delivery).unwrap();
    let mut joints = link.speak::<JointState>("/wire/joints", delivery).unwrap();
    let mut link = link.start().unwrap();
    while !link.find_lonely().is_empty() {
        link.wait(Duration::from_millis(50));
    }
    // Those who listen need a moment to know of us.
    link.wait(Duration::from_secs(1));
    let (start, cpu) = (Instant::now(), cpu_s());
    for tick in 0..(100.0 * seconds) as u32 {
        let due = start + Duration::from_millis(10) * tick;
        if let Some(left) = due.checked_duration_since(Instant::now()) {
            link.wait(left);
        }
        let header = Header::new(now(), "");
        let name = (0..9).map(|joint| format!("joint_{joint}")).collect();
        joints
            .say(JointState { header, name, position: vec![0.1; 9], velocity: vec![0.0; 9], effort: vec![] })
            .unwrap();
        if tick % 10 == 0 {
            color.say(image("rgb8", 3, (tick % 251) as u8)).unwrap();
            depth.say(image("16UC1", 2, (tick % 251) as u8)).unwrap();
        }
    }
    let share = 100.0 * (cpu_s() - cpu) / start.elapsed().as_secs_f64();
    println!("sent: color {}, depth {}, joints {}; {share:.1} % of a core", color.sent(), depth.sent(), joints.sent());
    // What was lost is sent again as long as we are there.
    link.wait(Duration::from_secs(2));
}

fn hear(delivery: Delivery, seconds: f64) {
    let mut link = LinkBuilder::new("wire_listener", DOMAIN).unwrap();
    let age_ms = |header: &Header| (now().0 - Stamp::from(header.stamp).0) as f64 * 1e-6;
    let whole = |image: &Image| image.data.iter().all(|byte| *byte == image.data[0]);
    link.listen("/wire/color", delivery, move |m: Image| (0, age_ms(&m.header), m.data.len() == 921_600 && whole(&m)))
        .unwrap();
    link.listen("/wire/depth", delivery, move |m: Image| (1, age_ms(&m.header), m.data.len() == 614_400 && whole(&m)))
        .unwrap();
    link.listen("/wire/joints", delivery, move |m: JointState| (2, age_ms(&m.header), m.position.len() == 9)).unwrap();
    let mut link = link.start().unwrap();
    let (mut ages, mut broken): ([Vec<f64>; 3], u32) = Default::default();
    let mut begun: Option<(Instant, f64)> = None;
    while begun.is_none_or(|(start, _)| start.elapsed().as_secs_f64() < seconds + 2.0) {
        if let Some((kind, age_ms, is_whole)) = link.wait(Duration::from_millis(50)) {
            begun.get_or_insert_with(|| (Instant::now(), cpu_s()));
            ages[kind].push(age_ms);
            broken += u32::from(!is_whole);
        }
    }
    for (name, ages) in ["color", "depth", "joints"].iter().zip(&mut ages) {
        ages.sort_by(f64::total_cmp);
        let at = |share: f64| ages.get(((ages.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "{name}: received {}, median {:.2} ms, 99 % {:.2} ms, longest {:.2} ms",
            ages.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
    if let Some((start, cpu)) = begun {
        println!("broken {broken}; {:.1} % of a core", 100.0 * (cpu_s() - cpu) / start.elapsed().as_secs_f64());
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let [role, delivery, seconds] = words[..] else {
        return println!("expected: say|hear reliable|best-effort SECONDS");
    };
    let delivery = match delivery {
        "reliable" => Delivery::Reliable { depth: 16 },
        _ => Delivery::BestEffort { depth: 16 },
    };
    let seconds: f64 = seconds.parse().unwrap_or(20.0);
    if role == "say" { say(delivery, seconds) } else { hear(delivery, seconds) }
}
