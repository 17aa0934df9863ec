#include "scene/camera_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "files/json_node.h"
#include "refine/camera_view.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kPathVersion = 1;
/// Where round the data a camera without an eye has to see all of it.
constexpr int kDirections = 72;

/// All that a key has, to be interpolated.
using Coordinates = std::array<double, 11>;

Coordinates coordinatesOf(const CameraKey& key) {
    const Vec3d &e = key.eyeWorld, &t = key.targetWorld, &u = key.up;
    return {e.x, e.y, e.z, t.x, t.y, t.z, u.x, u.y, u.z, key.openingDegrees, key.heightWorld};
}

SceneCamera cameraFrom(const Coordinates& c) {
    SceneCamera camera;
    camera.eyeWorld = Vec3d(c[0], c[1], c[2]);
    camera.targetWorld = Vec3d(c[3], c[4], c[5]);
    camera.up = Vec3d(c[6], c[7], c[8]);
    camera.openingDegrees = std::clamp(c[9], 0.1, 170.0);
    camera.heightWorld = std::max(c[10], 0.0);
    return camera;
}

CameraKey readKey(const JsonNode& json, std::size_t number) {
    json.expectKeys({"time", "eye", "target", "up", "opening", "height"});
    CameraKey key;
    const auto time = json.find("time");
    key.time = time ? time->number() : double(number);
    key.eyeWorld = json.at("eye").vector();
    key.targetWorld = json.at("target").vector();
    if (key.targetWorld == key.eyeWorld) json.at("target").fail("another place than the eye");
    if (const auto up = json.find("up")) {
        key.up = up->vector();
        if (const double length = glm::length(key.up); length > 0 && std::isfinite(length))
            key.up /= length;
        else
            up->fail("a direction of a length above 0");
    }
    const auto opening = json.find("opening"), height = json.find("height");
    if (opening && height) opening->refuse("can't stand beside height");
    if (opening) key.openingDegrees = opening->number(0.1, 170);
    if (height) key.heightWorld = height->length();
    return key;
}

/// By an angle around a direction of length 1.
Vec3d turned(const Vec3d& v, const Vec3d& around, double angle) {
    return v * std::cos(angle) + glm::cross(around, v) * std::sin(angle) +
           around * glm::dot(around, v) * (1 - std::cos(angle));
}

}  // namespace

CameraPath::CameraPath(std::vector<CameraKey> keys) : keys_(std::move(keys)) {
    TESSERA_CHECK(!keys_.empty(), "a path has a key");
    for (std::size_t k = 1; k < keys_.size(); ++k)
        TESSERA_CHECK(keys_[k - 1].time < keys_[k].time, "keys ascend by time");
}

SceneCamera CameraPath::at(double time) const {
    const auto above =
        std::find_if(keys_.begin(), keys_.end(), [&](const CameraKey& key) { return key.time > time; });
    if (above == keys_.begin()) return cameraFrom(coordinatesOf(keys_.front()));
    if (above == keys_.end()) return cameraFrom(coordinatesOf(keys_.back()));
    const auto b = std::size_t(above - keys_.begin()), a = b - 1;
    const auto slopeAt = [&](std::size_t key, std::size_t coordinate) {
        const CameraKey &before = keys_[key > 0 ? key - 1 : 0],
                        &behind = keys_[std::min(key + 1, keys_.size() - 1)];
        return (coordinatesOf(behind)[coordinate] - coordinatesOf(before)[coordinate]) /
               (behind.time - before.time);
    };
    const double length = keys_[b].time - keys_[a].time, t = (time - keys_[a].time) / length;
    const Coordinates from = coordinatesOf(keys_[a]), to = coordinatesOf(keys_[b]);
    Coordinates now{};
    for (std::size_t c = 0; c < now.size(); ++c)
        now[c] = (1 + 2 * t) * (1 - t) * (1 - t) * from[c] + t * t * (3 - 2 * t) * to[c] +
                 length * (t * (1 - t) * (1 - t) * slopeAt(a, c) - t * t * (1 - t) * slopeAt(b, c));
    return cameraFrom(now);
}

CameraPath readCameraPath(const std::string& path) {
    const JsonNode json = JsonNode::read(path, "the camera's path");
    json.expectKeys({"version", "keys"});
    if (json.at("version").number() != kPathVersion) json.at("version").fail("1, the version of this format");
    const auto list = json.at("keys").list("a list of keys");
    if (list.empty()) json.at("keys").fail("at least one key");
    std::vector<CameraKey> keys;
    for (const JsonNode& node : list) {
        const CameraKey key = readKey(node, keys.size());
        if (!keys.empty()) {
            if (bool(node.find("time")) != bool(list.front().find("time")))
                node.refuse("all keys have a time, or none has");
            if (!(key.time > keys.back().time)) node.at("time").fail("a later time than the key before");
            if ((key.heightWorld > 0) != (keys.front().heightWorld > 0))
                node.refuse("all keys have a height, or none has");
        }
        keys.push_back(key);
    }
    return CameraPath(std::move(keys));
}

SceneCamera orbited(const Scene& scene, const Box3d& boundsWorld, int legendPixels, double share) {
    const Vec3d middle = 0.5 * (boundsWorld.min + boundsWorld.max), up = glm::normalize(scene.camera.up);
    SceneCamera camera = scene.camera;
    camera.targetWorld = scene.camera.targetWorld.value_or(middle);
    const double angle = 2 * std::numbers::pi * share;
    if (scene.camera.eyeWorld) {
        camera.eyeWorld = *camera.targetWorld + turned(*camera.eyeWorld - *camera.targetWorld, up, angle);
        return camera;
    }
    double farthest = 0;
    Scene turning = scene;
    for (int n = 0; n < kDirections; ++n) {
        turning.camera.direction = turned(scene.camera.direction, up, 2 * std::numbers::pi * n / kDirections);
        const Camera fitted = cameraOf(turning, boundsWorld, legendPixels);
        farthest = std::max(farthest, glm::length(fitted.eyeWorld - middle));
        camera.heightWorld = std::max(camera.heightWorld, fitted.heightWorld);
    }
    camera.isParallel = false;  // the height says so
    camera.eyeWorld = middle - farthest * turned(glm::normalize(scene.camera.direction), up, angle);
    return camera;
}

}  // namespace tessera
