//! Time of one image of 640 x 480 pixels, colour, depth and labels: 60 bodies, 50 000 triangles, two lights, with the
//! shadows of one of them and without.
#![allow(missing_docs, reason = "the macros of criterion write undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::camera::CameraModel;
use dsm::raster::{Image, RenderOptions, Renderer};

#[path = "../tests/raster_room/mod.rs"]
mod raster_room;

fn bench(criterion: &mut Criterion) {
    let plain = raster_room::room(82);
    let mut shaded = plain.clone();
    shaded.cast_shadows(0);
    let camera = CameraModel::from_vertical_fov(640, 480, 1.0);
    let (options, pose) = (RenderOptions::default(), raster_room::view());
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can start");
        let (mut renderer, mut image) = (Renderer::default(), Image::default());
        for (kind, scene) in [("plain", &plain), ("shadows", &shaded)] {
            let name = format!("room_{}_triangles_{kind}_{threads}_threads", scene.triangle_count());
            criterion.bench_function(&name, |bencher| {
                bencher.iter(|| pool.install(|| renderer.render_into(scene, &camera, &pose, &options, &mut image)));
            });
        }
    }
}

criterion_group!(raster, bench);
criterion_main!(raster);
