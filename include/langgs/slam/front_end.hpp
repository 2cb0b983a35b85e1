// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/io/tum_trajectory.hpp"
#include "langgs/slam/report.hpp"
#include "langgs/slam/settings.hpp"
#include "langgs/track/agreement.hpp"
#include "langgs/track/gicp_tracker.hpp"
#include "langgs/track/grid_target.hpp"
#include "langgs/track/motion_model.hpp"
#include "langgs/track/relocalizer.hpp"
#include "langgs/track/rotation_alignment.hpp"
#include "langgs/track/synchronise.hpp"

namespace langgs {

/// A frame after tracking, with what mapping reuses from it.
struct TrackedFrame {
  FrameReport report;
  SourceCloud cloud;   ///< of a keyframe: in the frame of the colour camera
  Image<float> depth;  ///< of a keyframe: as seen from where colour was taken; empty if that is where depth was taken
  std::vector<float> squared_distance;  ///< [N] to the nearest map Gaussian; infinite where not known (section 3.3.2)
};

/// The tracking side (paper section 3): depth image -> source Gaussians -> G-ICP against the map -> keyframe decision.
class FrontEnd {
 public:
  FrontEnd(const Camera& camera, const TrackingSettings& settings)
      : camera_(camera), settings_(settings), tracker_(settings.gicp), motion_(settings.initial_guess) {
    validate(camera_);
  }

  /// The map as tracking sees it. Shared: mapping goes on with a map of its own.
  void set_target(std::shared_ptr<const GridTarget> target) { target_ = std::move(target); }

  /// Poses of all frames so far. Frames whose time stamp is not finite are left out.
  [[nodiscard]] std::vector<StampedPose> trajectory() const { return refined_trajectory(std::vector<NoKeyframe>{}); }

  /// The same given the current keyframes: a frame moves with the keyframe before it.
  template <class Keyframes>
  [[nodiscard]] std::vector<StampedPose> refined_trajectory(const Keyframes& keyframes) const {
    std::vector<StampedPose> result;
    Pose correction = Pose::Identity();  // of the newest keyframe so far
    auto keyframe = keyframes.begin();
    for (int i = 0; i < num_frames(); ++i) {
      if (keyframe != keyframes.end() && keyframe->frame_index == i) {
        correction = keyframe->T_world_camera * keyframe->T_world_camera_tracked.inverse();
        ++keyframe;
      }
      if (std::isfinite(records_[i].timestamp))
        result.push_back({records_[i].timestamp, renormalized(correction * records_[i].T_world_camera)});
    }
    return result;
  }

  template <KeyframeSelector Policy>
  [[nodiscard]] TrackedFrame track(const RgbdFrame& frame, const FrameRole& role, Policy& keyframe_policy,
                                   WorkerPool& pool) {
    const auto start = std::chrono::steady_clock::now();
    TrackedFrame tracked;
    FrameReport& report = tracked.report;
    report.frame_index = static_cast<int>(records_.size());
    expect_shape(frame);
    report.T_world_camera = motion_.predict(frame.timestamp);
    report.reason = unusable(frame, role);
    if (report.reason.empty()) {
      tracked.cloud = make_source_cloud(frame, camera_, settings_.source, pool);
      if (tracked.cloud.num_trackable() < settings_.gicp.min_correspondences) report.reason = "too little valid depth";
    }
    report.skipped = !report.reason.empty();
    if (!report.skipped) locate(frame, tracked, pool);

    const bool placed = !report.skipped && report.reason.empty();
    if (placed && !role.held_out)
      report.keyframe = keyframe_policy.decide(report.overlap, target_ == nullptr, role.is_last);
    if (report.keyframe != KeyframeKind::none) synchronise(frame, tracked);
    remember(frame, report);
    milliseconds_.push_back(std::chrono::duration<float, std::milli>(std::chrono::steady_clock::now() - start).count());
    return tracked;
  }

  [[nodiscard]] int num_frames() const { return static_cast<int>(records_.size()); }
  [[nodiscard]] int num_lost() const { return lost_; }
  [[nodiscard]] int num_relocalized() const { return relocalizations_; }
  [[nodiscard]] int num_skipped() const { return skipped_; }
  [[nodiscard]] const std::vector<float>& milliseconds() const { return milliseconds_; }

 private:
  struct NoKeyframe {
    int frame_index = -1;
    Pose T_world_camera, T_world_camera_tracked;
  };
  struct Record {
    double timestamp;
    Pose T_world_camera;  ///< as tracked or predicted
  };

  void expect_shape(const RgbdFrame& frame) const {
    LANGGS_EXPECTS(frame.colour.width() == camera_.width && frame.colour.height() == camera_.height &&
                       frame.colour.channels() == 3,
                   "colour image of frame ", records_.size(), " is [", frame.colour.height(), ", ",
                   frame.colour.width(), ", ", frame.colour.channels(), "], the camera gives [", camera_.height, ", ",
                   camera_.width, ", 3]; resize the image or the intrinsics (Camera::resized)");
    LANGGS_EXPECTS(frame.depth.width() == camera_.width && frame.depth.height() == camera_.height,
                   "depth image of frame ", records_.size(), " is [", frame.depth.height(), ", ", frame.depth.width(),
                   "], the camera gives [", camera_.height, ", ", camera_.width, "]; register depth to colour first");
  }

  /// Why a frame cannot be used; empty if it can.
  [[nodiscard]] std::string unusable(const RgbdFrame& frame, const FrameRole& role) const {
    if (!std::isfinite(frame.timestamp) || !std::isfinite(frame.depth_time_offset))
      return "its time stamp is not finite";
    if (frame.timestamp < last_timestamp_) return "its time stamp lies before the previous frame's";
    if (settings_.poses == PoseSource::gicp)
      return role.held_out && target_ == nullptr ? "it is held out, and there is no map yet to track it against" : "";
    if (!frame.T_world_camera) return "it has no given pose";
    if (!is_finite(*frame.T_world_camera)) return "its given pose is not finite";
    return {};
  }

  /// Pose, overlap and correspondence distances of a usable frame. What is registered is the depth image, and the
  /// motion model is one of the depth camera; what is reported is the pose of the colour image.
  void locate(const RgbdFrame& frame, TrackedFrame& tracked, WorkerPool& pool) {
    FrameReport& report = tracked.report;
    const bool given = settings_.poses == PoseSource::given, first = target_ == nullptr;
    const double depth_time = frame.timestamp + frame.depth_time_offset;
    Pose T_world_depth = motion_.predict(depth_time);
    if (given) T_world_depth = *frame.T_world_camera * motion_.motion(frame.depth_time_offset);
    if (first) {  // it defines the map
      tracked.squared_distance.assign(tracked.cloud.size(), std::numeric_limits<float>::infinity());
    } else {
      tracked.cloud.T_colour_depth = motion_.motion(frame.depth_time_offset);
      GicpResult result = given ? tracker_.evaluate(tracked.cloud, *target_, T_world_depth, pool)
                                : tracker_.align(tracked.cloud, *target_, turned(T_world_depth, frame, tracked), pool);
      report.agreement = depth_agreement(*target_, frame.depth, camera_, result.T_world_camera).share();
      if (!given && (is_lost_ || !is_credible(result, report.agreement))) {
        is_lost_ = !relocalize(frame, tracked.cloud, result, pool);
        if (!is_lost_) {
          ++relocalizations_;
          report.agreement = depth_agreement(*target_, frame.depth, camera_, result.T_world_camera).share();
          motion_.restart(result.T_world_camera, depth_time);
        }
      }
      report.status = result.status;
      report.overlap = result.overlap;
      if (!is_lost_) T_world_depth = result.T_world_camera;
      tracked.squared_distance = std::move(result.squared_distance);
      if (is_lost_) {
        report.T_world_camera = motion_.predict(frame.timestamp);
        report.reason = "tracking lost: too little of the map in view, or a motion too large";
        ++lost_;
        return;
      }
    }
    if (first)
      motion_.restart(T_world_depth, depth_time);
    else if (depth_time > motion_.time())
      motion_.observe(T_world_depth, depth_time);
    report.T_world_camera =
        given ? *frame.T_world_camera : renormalized(T_world_depth * motion_.motion(-frame.depth_time_offset));
    last_image_ = tracked.cloud.intensity;
    T_world_last_image_ = report.T_world_camera;
  }

  /// The predicted pose of the depth camera, turned by what the images say about the rotation since the last frame.
  [[nodiscard]] Pose turned(const Pose& T_world_depth, const RgbdFrame& frame, const TrackedFrame& tracked) const {
    constexpr double kWorthIt = 0.8;  // of the difference of the images that prediction leaves
    const Eigen::Matrix3d predicted = motion_.predict(frame.timestamp).linear(), last = T_world_last_image_.linear();
    const RotationAlignment found = align_rotation(last_image_, tracked.cloud.intensity, last.transpose() * predicted);
    if (!(found.difference < kWorthIt * found.initial_difference)) return T_world_depth;
    Pose result = T_world_depth;
    result.linear() = last * found.R_last_now * predicted.transpose() * T_world_depth.linear();
    return renormalized(result);
  }

  /// Whether a registration is to be believed: the map may not stand where the camera looks through.
  [[nodiscard]] bool is_credible(const GicpResult& result, double agreement) const {
    return has_pose(result.status) && result.overlap >= settings_.min_overlap && agreement >= settings_.min_agreement;
  }

  /// Looks for the camera among the keyframes and around the last good pose; false, and `result` as it was, if nothing
  /// is found. Asks for more than a frame that was never lost.
  bool relocalize(const RgbdFrame& frame, const SourceCloud& cloud, GicpResult& result, WorkerPool& pool) const {
    constexpr int kTried = 4;
    constexpr double kMinAgreement = 0.9, kMinOverlap = 0.3;
    const auto share = [&](const Pose& pose) {
      const DepthAgreement a = depth_agreement(*target_, frame.depth, camera_, pose);
      return a.confirmed < DepthAgreement::kFewest ? 0 : a.share();
    };
    std::vector<std::pair<double, Pose>> order;
    for (const Pose& pose : relocalizer_.candidates(motion_.last(), cloud.intensity))
      order.emplace_back(share(pose), pose);
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    for (std::size_t i = 0; i < std::min<std::size_t>(kTried, order.size()); ++i) {
      GicpResult found = tracker_.align(cloud, *target_, order[i].second, pool);
      if (!has_pose(found.status) || found.overlap < kMinOverlap || share(found.T_world_camera) < kMinAgreement)
        continue;
      result = std::move(found);
      return true;
    }
    return false;
  }

  /// Brings the depth of a keyframe to where its colour was taken.
  void synchronise(const RgbdFrame& frame, TrackedFrame& tracked) const {
    if (frame.depth_time_offset == 0) return;
    const Pose T_colour_depth = motion_.motion(frame.depth_time_offset);
    tracked.depth = depth_from_colour(frame.depth, camera_, T_colour_depth);
    move_to_colour(tracked.cloud, camera_, T_colour_depth);
  }

  void remember(const RgbdFrame& frame, const FrameReport& report) {
    if (report.skipped) ++skipped_;
    if (report.keyframe != KeyframeKind::none) relocalizer_.remember(report.T_world_camera, last_image_);
    if (std::isfinite(frame.timestamp)) last_timestamp_ = std::max(last_timestamp_, frame.timestamp);
    records_.push_back({frame.timestamp, report.T_world_camera});
  }

  Camera camera_;
  TrackingSettings settings_;
  GicpTracker tracker_;
  MotionModel motion_;
  std::shared_ptr<const GridTarget> target_;
  std::vector<Record> records_;
  Relocalizer relocalizer_;
  IntensityImage last_image_;  ///< of the last frame with a pose
  Pose T_world_last_image_ = Pose::Identity();
  bool is_lost_ = false;
  int lost_ = 0, relocalizations_ = 0, skipped_ = 0;
  double last_timestamp_ = -std::numeric_limits<double>::infinity();
  std::vector<float> milliseconds_;
};

}  // namespace langgs
