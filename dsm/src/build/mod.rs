//! Construction of the map from frames and detections.
