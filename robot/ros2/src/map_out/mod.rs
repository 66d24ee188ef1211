//! The map for others: its objects, relations, rooms and what words mean, as standard messages; a service that grounds text.
//!
//! ```text
//! map ──▶ /dsm/objects (vision_msgs), /dsm/markers (visualization_msgs)
//! /dsm/ground_text ──text──▶ answer ──▶ /dsm/grounding
//! ```

mod drawing;

pub use drawing::{markers_of, meant_markers, objects_of};

use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder, Speaker};
use crate::messages::{Detection3DArray, GroundTextRequest, GroundTextResponse, MarkerArray};
use dsm::map::Map;
use dsm::time::Stamp;

/// The objects.
pub const OBJECTS_TOPIC: &str = "/dsm/objects";
/// Objects, relations and rooms as a viewer draws them.
pub const MARKERS_TOPIC: &str = "/dsm/markers";
/// What the last text was grounded to.
pub const GROUNDING_TOPIC: &str = "/dsm/grounding";
/// Grounds a text in the map.
pub const GROUND_TEXT: &str = "/dsm/ground_text";

/// What a text is grounded to, with the markers that show it.
pub type Grounded = (GroundTextResponse, MarkerArray);

/// Publishes a map and answers questions about it.
pub struct MapOut {
    /// Ends with the map.
    _link: Link<()>,
    objects: Speaker<Detection3DArray>,
    markers: Speaker<MarkerArray>,
}

impl MapOut {
    /// Joins the graph; `ground` answers texts, on a thread of its own.
    ///
    /// # Errors
    /// [`Ros2Error`].
    pub fn start(domain: u16, mut ground: impl FnMut(&str) -> Grounded + Send + 'static) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_map", domain)?;
        let objects = link.speak_aside(OBJECTS_TOPIC, Delivery::Kept)?;
        let markers = link.speak_aside(MARKERS_TOPIC, Delivery::Kept)?;
        let mut grounding = link.speak_aside(GROUNDING_TOPIC, Delivery::Kept)?;
        link.answer(GROUND_TEXT, "dsm_msgs", "GroundText", move |asked: GroundTextRequest| {
            let (response, markers) = ground(&asked.text);
            if let Err(error) = grounding.say(markers) {
                tracing::warn!("{error}");
            }
            response
        })?;
        Ok(Self { _link: link.start()?, objects, markers })
    }

    /// Publishes the map of a moment; `Err` with why when it cannot.
    pub fn publish(&mut self, map: &Map, stamp: Stamp) -> Result<(), String> {
        self.objects.say(objects_of(map, stamp))?;
        self.markers.say(markers_of(map, stamp))
    }
}
