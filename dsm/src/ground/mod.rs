//! DSM-Grounding: from words to one object or room of the map.
