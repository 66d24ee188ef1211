//! Contract: pictures show what the data holds, at the place where it lies, and text never turns into markup.
use super::*;
use dsm::geometry::OrientedBox;
use dsm::map::{Attributes, MapChange, MapPoint, MapUpdate, ObjectState, Votes};
use dsm::time::Stamp;

/// A map of 4 m x 2 m free ground with one red box at (3.0, 1.5).
pub(crate) fn small_map(name: &str) -> Map {
    let mut names = Votes::default();
    names.add(name, 1.0);
    let points = (0..400)
        .map(|i| (f32::from((i % 20) as u8) - 9.5, f32::from((i / 20) as u8) - 9.5))
        .map(|(x, y)| MapPoint { position: Point3::new(3.0 + 0.01 * x, 1.5 + 0.01 * y, 0.4), color: [200, 20, 10] });
    let object = MapObject {
        id: ObjectId(7),
        state: ObjectState::Stable,
        names,
        points: points.collect(),
        bounds: OrientedBox {
            center: Point3::new(3.0, 1.5, 0.2),
            size: Vector3::new(0.2, 0.2, 0.4),
            rotation: UnitQuaternion::identity(),
        },
        attributes: Attributes::default(),
        visual_feature: vec![1.0],
        provenance: Default::default(),
        text_feature: vec![1.0],
        room: None,
        observations: 5,
        first_seen: Stamp::default(),
        last_seen: Stamp::default(),
    };
    let cells = (0..80).flat_map(|x| (0..40).map(move |y| ([x, y], CellState::Free))).collect();
    let mut map = Map::new(0.05);
    map.apply(MapUpdate {
        stamp: Stamp::default(),
        changes: vec![MapChange::Put(Box::new(object)), MapChange::Cells(cells)],
    });
    map
}

/// A frame of 8 x 6 pixels: the left half red and 1 m away, the right half blue without return.
pub(crate) fn small_frame() -> RgbdFrame {
    let model = CameraModel::from_vertical_fov(8, 6, 1.0);
    let left = |i: usize| i % 8 < 4;
    RgbdFrame {
        id: dsm::frame::FrameId(1),
        stamp: Stamp::default(),
        camera: "head".into(),
        model,
        world_from_camera: Pose::identity(),
        color: (0..48).map(|i| if left(i) { [250, 0, 0] } else { [0, 0, 250] }).collect(),
        depth_m: (0..48).map(|i| if left(i) { 1.0 } else { 0.0 }).collect(),
    }
}

fn decode(bytes: &[u8]) -> (u32, u32, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let mut buffer = vec![0; reader.output_buffer_size().expect("size")];
    let info = reader.next_frame(&mut buffer).expect("pixels");
    (info.width, info.height, buffer.as_chunks::<3>().0.to_vec())
}

#[test]
fn frames_come_back_from_their_png() {
    let frame = small_frame();
    let (width, height, pixels) = decode(&color_png(&frame));
    assert_eq!((width, height), (8, 6));
    assert_eq!(pixels, frame.color);
    let (_, _, depth) = decode(&depth_png(&frame));
    assert_eq!(depth[7], [0; 3], "no return is black");
    assert_ne!(depth[0], [0; 3]);
    assert_ne!(color_of_depth(1.0), color_of_depth(3.0));
}

#[test]
fn half_a_frame_keeps_colours_and_geometry() {
    let frame = small_frame();
    let small = halved(&frame);
    assert_eq!((small.model.width, small.model.height, small.color.len()), (4, 3, 12));
    assert_eq!((small.color[0], small.color[3]), ([250, 0, 0], [0, 0, 250]));
    assert_eq!(small.model.back_project(3, 2, 1.0).x, frame.model.back_project(6, 4, 1.0).x + 0.5 / frame.model.fx);
}

#[test]
fn the_map_picture_shows_things_where_they_are() {
    let map = small_map("box");
    let path = [Point2::new(0.5, 0.5), Point2::new(1.5, 0.5)];
    let (width, height, pixels) = decode(&map_png(&map, &path, None, 50.0).expect("a map"));
    assert_eq!((width, height), (230, 130), "4 m x 2 m with 0.3 m around, 50 pixels to a metre");
    // World (x, y) in pixels: y runs up.
    let at = |x: f64, y: f64| pixels[(((2.3 - y) * 50.0) as u32 * width + ((x + 0.3) * 50.0) as u32) as usize];
    assert_eq!(at(3.0, 1.5), [200, 20, 10], "the object's own colour");
    assert_eq!(at(1.0, 1.5), FREE);
    assert_eq!(at(-0.2, 1.5), UNKNOWN);
    assert_eq!(at(1.0, 0.5), PATH);
}

#[test]
fn the_map_drawing_is_well_formed_and_escapes_names() {
    let map = small_map("</text><script>alert('&')</script>");
    let svg = map_svg(&map, &[Point2::new(1.0, 1.0)], Some(ObjectId(7))).expect("a map");
    assert!(!svg.contains("<script"), "{svg}");
    assert!(svg.contains("&lt;script&gt;alert(&#39;&amp;&#39;)"));
    assert!(svg.contains(&hex(TARGET)), "the target is marked");
    assert!(svg.contains("viewBox=\"0 0 460 260\""), "{svg}");
    // 40 rows of free cells are 40 rectangles, not 3200.
    assert_eq!(svg.matches('M').count(), 40);
    for tag in ["svg", "text", "title", "polygon"] {
        let closed = svg.matches(&format!("</{tag}>")).count();
        let alone = svg.lines().filter(|l| l.starts_with(&format!("<{tag} ")) && l.ends_with("/>")).count();
        assert_eq!(svg.matches(&format!("<{tag} ")).count() + svg.matches(&format!("<{tag}>")).count(), closed + alone);
    }
}

#[test]
fn an_empty_map_has_no_picture() {
    assert_eq!(map_svg(&Map::new(0.05), &[], None), None);
    assert_eq!(map_png(&Map::new(0.05), &[], None, 50.0), None);
}
