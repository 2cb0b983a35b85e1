// SPDX-License-Identifier: Apache-2.0
#include "common/trajectory_plot.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "langgs/eval/trajectory.hpp"

namespace langgs::examples {

namespace {

/// The reference poses of the estimate's time, in the estimate's world; empty if they cannot be aligned.
std::vector<Eigen::Vector3d> aligned(const std::vector<StampedPose>& estimate, std::vector<StampedPose> reference) {
  std::vector<Eigen::Vector3d> points;
  if (estimate.empty()) return points;
  std::erase_if(reference, [&](const StampedPose& pose) {
    return pose.timestamp < estimate.front().timestamp || pose.timestamp > estimate.back().timestamp;
  });
  try {
    const Pose T_estimate_reference = ate_umeyama_se3(estimate, reference).T_reference_estimate.inverse();
    for (const StampedPose& pose : reference)
      points.push_back(T_estimate_reference * pose.T_world_camera.translation());
  } catch (const InvalidArgument&) {
    // Fewer than three pairs.
  }
  return points;
}

}  // namespace

cv::Mat trajectory_picture(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& reference,
                           int width, int height) {
  const cv::Scalar paper(250, 250, 250), soft(120, 120, 120), grey(185, 185, 185), blue(190, 110, 30);
  cv::Mat sheet(height, width, CV_8UC3, paper);
  const auto text = [&](const std::string& words, cv::Point at, const cv::Scalar& colour) {
    cv::putText(sheet, words, at, cv::FONT_HERSHEY_DUPLEX, 0.45, colour, 1, cv::LINE_AA);
  };
  text("trajectory from above", {0, 18}, soft);
  const std::vector<Eigen::Vector3d> truth = aligned(estimate, reference);
  std::vector<Eigen::Vector3d> way;
  for (const StampedPose& pose : estimate) way.push_back(pose.T_world_camera.translation());
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  for (const std::vector<Eigen::Vector3d>& points : {way, truth})
    for (const Eigen::Vector3d& p : points) {
      low = low.cwiseMin(Eigen::Vector2d(p.x(), p.z()));
      high = high.cwiseMax(Eigen::Vector2d(p.x(), p.z()));
    }
  if (!(low.x() <= high.x())) return sheet;
  constexpr int kTop = 30, kBottom = 40, kSide = 10;
  const double extent_x = std::max(high.x() - low.x(), 1e-3), extent_z = std::max(high.y() - low.y(), 1e-3);
  const double scale = std::min((width - 2 * kSide) / extent_x, (height - kTop - kBottom) / extent_z);
  constexpr int kShift = 4;  // OpenCV draws at sixteenths of a pixel
  const auto draw = [&](const std::vector<Eigen::Vector3d>& points, const cv::Scalar& colour, int thickness) {
    std::vector<cv::Point> line;
    for (const Eigen::Vector3d& p : points)
      line.emplace_back(static_cast<int>((kSide + (p.x() - low.x()) * scale) * (1 << kShift)),
                        static_cast<int>((height - kBottom - (p.z() - low.y()) * scale) * (1 << kShift)));
    cv::polylines(sheet, line, false, colour, thickness, cv::LINE_AA, kShift);
    if (!line.empty()) cv::circle(sheet, line.front(), 4 << kShift, colour, cv::FILLED, cv::LINE_AA, kShift);
  };
  draw(truth, grey, 4);
  draw(way, blue, 1);
  // A scale bar of 1, 2 or 5 times a power of ten metres, about a quarter of the width.
  const double power = std::pow(10.0, std::floor(std::log10(0.3 * width / scale)));
  const double metres = power * (0.3 * width / scale >= 5 * power ? 5 : 0.3 * width / scale >= 2 * power ? 2 : 1);
  const int bar = static_cast<int>(metres * scale);
  cv::line(sheet, {kSide, height - 14}, {kSide + bar, height - 14}, soft, 2, cv::LINE_AA);
  char label[48];
  std::snprintf(label, sizeof(label), "%g m", metres);
  text(label, {kSide + bar + 8, height - 9}, soft);
  text("estimate", {width - 170, height - 9}, blue);
  if (!truth.empty()) text("reference", {width - 85, height - 9}, grey);
  return sheet;
}

}  // namespace langgs::examples
