float shared_value(float layerValue, vec2 place) {
    return layerValue + floor(place.x) / 16.0 + floor(place.y) / 256.0;
}
