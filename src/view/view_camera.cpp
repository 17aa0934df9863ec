#include "view/view_camera.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

namespace tessera {

namespace {

/// Half a turn for a hand that moves over the whole picture.
constexpr double kRadiansAPicture = glm::pi<double>();
constexpr double kLeastToPole = 0.01;  // radians

Vec3d turned(const Vec3d& v, const Vec3d& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return c * v + s * glm::cross(axis, v) + (1 - c) * glm::dot(axis, v) * axis;
}

}  // namespace

ViewCamera ViewCamera::of(const Camera& camera, const Vec3d& targetWorld) {
    ViewCamera view;
    view.eyeWorld = camera.eyeWorld;
    const Vec3d forward = glm::normalize(camera.forwardWorld);
    // On the line of sight, as far away as the place given.
    const double along = glm::dot(targetWorld - camera.eyeWorld, forward);
    const double away = glm::length(targetWorld - camera.eyeWorld);
    view.targetWorld = camera.eyeWorld + (along > 0 ? along : std::max(away, 1e-300)) * forward;
    view.up = glm::normalize(camera.upWorld);
    view.openingDegrees = camera.openingDegrees;
    view.heightWorld = camera.heightWorld;
    return view;
}

SceneDocument::Json ViewCamera::json() const {
    const auto list = [](const Vec3d& v) { return SceneDocument::Json{v.x, v.y, v.z}; };
    SceneDocument::Json json{{"eye", list(eyeWorld)}, {"target", list(targetWorld)}, {"up", list(up)}};
    if (heightWorld > 0)
        json["height"] = heightWorld;
    else
        json["opening"] = openingDegrees;
    return json;
}

Vec3d ViewCamera::forward() const {
    return glm::normalize(targetWorld - eyeWorld);
}

double ViewCamera::heightAtTarget() const {
    if (heightWorld > 0) return heightWorld;
    return 2 * std::tan(openingDegrees * glm::pi<double>() / 360) * glm::length(targetWorld - eyeWorld);
}

void ViewCamera::orbit(double right, double up_) {
    Vec3d back = eyeWorld - targetWorld;
    back = turned(back, up, -right * kRadiansAPicture);
    const double toPole = std::acos(std::clamp(glm::dot(glm::normalize(back), up), -1.0, 1.0));
    const double tilt =
        std::clamp(toPole + up_ * kRadiansAPicture, kLeastToPole, glm::pi<double>() - kLeastToPole) - toPole;
    Vec3d axis = glm::cross(up, back);
    // Seen from a pole any axis will do.
    if (glm::length(axis) < 1e-9 * glm::length(back))
        axis = std::abs(up.x) < 0.9 ? glm::cross(up, Vec3d(1, 0, 0)) : glm::cross(up, Vec3d(0, 1, 0));
    eyeWorld = targetWorld + turned(back, glm::normalize(axis), tilt);
}

void ViewCamera::pan(double right, double up_) {
    const Vec3d across = glm::normalize(glm::cross(forward(), up));
    const Vec3d above = glm::cross(across, forward());
    const Vec3d shift = -heightAtTarget() * (right * across + up_ * above);
    eyeWorld += shift;
    targetWorld += shift;
}

void ViewCamera::zoom(double factor) {
    if (heightWorld > 0)
        heightWorld /= factor;
    else
        eyeWorld = targetWorld + (eyeWorld - targetWorld) / factor;
}

void ViewCamera::fly(double forward_, double right, double up_) {
    const Vec3d ahead = forward(), across = glm::normalize(glm::cross(ahead, up));
    const double distance = glm::length(targetWorld - eyeWorld);
    const Vec3d shift = distance * (forward_ * ahead + right * across + up_ * glm::cross(across, ahead));
    eyeWorld += shift;
    targetWorld += shift;
}

}  // namespace tessera
