// SPDX-License-Identifier: Apache-2.0
// Registers the frame of alignment_scene.hpp by GicpTracker, by PCL's GICP and by OpenCV's rgbd ICP odometry, those
// that were found, in turns so that all see the same machine. Prints medians and the errors against the truth. To the
// map: the same source points, target points, and covariances of both; search trees are made before. Frame to frame:
// the neighbouring frame, three frames away, takes the place of the map; OpenCV's pyramids and normals are made before,
// as are the grid clouds. Usage: peers [ROUNDS]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "alignment_scene.hpp"
#include "langgs/track/gicp_tracker.hpp"

#ifdef LANGGS_WITH_PCL
#define PCL_NO_PRECOMPILE  // compiled like the rest, not for plain x86-64
#include <pcl/registration/gicp.h>
#endif
#ifdef LANGGS_WITH_RGBD
#include <opencv2/rgbd/depth.hpp>
#endif

namespace langgs::benchmarks {
namespace {

/// From a start to the pose found.
using Register = std::function<Pose(const Pose& start)>;

struct Contender {
  std::string name;
  int threads;
  Register align;
  std::vector<double> wall_ms = {}, processor_ms = {};
  MeanPoseError error = {};
};

Contender tracker(const char* name, int threads, const AlignmentScene& scene, const GridTarget& target) {
  const auto pool = std::make_shared<WorkerPool>(threads);
  return {name, threads, [&, pool](const Pose& start) {
            return GicpTracker().align(scene.source, target, start, *pool).T_world_camera;
          }};
}

/// What GicpTracker gets besides the map when it registers frame to frame.
std::vector<TargetGaussian> neighbour_points(const AlignmentScene& scene) {
  WorkerPool pool(1);
  const SourceCloud cloud = make_source_cloud(scene.neighbour, scene.camera, {}, pool);
  std::vector<std::int32_t> every(cloud.size());
  std::iota(every.begin(), every.end(), 0);
  return measured(cloud, every, scene.camera, scene.T_world_neighbour, TargetShape::anisotropic);
}

#ifdef LANGGS_WITH_PCL
/// One thread: PCL's GICP has no more.
Contender pcl_gicp(const AlignmentScene& scene) {
  using Gicp = pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ>;
  const auto point = [](const Eigen::Vector3f& p) { return pcl::PointXYZ(p.x(), p.y(), p.z()); };
  auto source = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>(), target = source;
  target = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  auto source_shape = std::make_shared<Gicp::MatricesVector>(), target_shape = std::make_shared<Gicp::MatricesVector>();
  for (int i = 0; i < scene.source.size(); ++i) {
    if (!scene.source.trackable[i]) continue;
    source->push_back(point(scene.source.points[i]));
    source_shape->push_back(scene.source.covariances[i].cast<double>());
  }
  for (const TargetGaussian& g : scene.target) {
    target->push_back(point(g.mean));
    const Symmetric3& c = g.covariance;
    Eigen::Matrix3f covariance;
    covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
    target_shape->push_back(covariance.cast<double>());
  }
  const GicpSettings ours;
  const auto gicp = std::make_shared<Gicp>();
  gicp->setInputTarget(target);
  gicp->setTargetCovariances(target_shape);
  gicp->setInputSource(source);
  gicp->setSourceCovariances(source_shape);
  gicp->setMaxCorrespondenceDistance(ours.max_distance);
  gicp->setTransformationEpsilon(ours.translation_epsilon);
  gicp->setRotationEpsilon(ours.rotation_epsilon);
  gicp->setMaximumIterations(ours.max_iterations);
  return {"pcl_gicp", 1, [gicp](const Pose& start) {
            pcl::PointCloud<pcl::PointXYZ> moved;
            gicp->align(moved, start.matrix().cast<float>());
            Pose found = Pose::Identity();
            found.matrix() = gicp->getFinalTransformation().cast<double>();
            return renormalized(found);
          }};
}
#endif

#ifdef LANGGS_WITH_RGBD
/// Threads are OpenCV's own: one setting for the whole program, set before every registration.
Contender rgbd_icp(const AlignmentScene& scene, int threads) {
  const Camera& c = scene.camera;
  const cv::Mat intrinsics = (cv::Mat_<double>(3, 3) << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  const auto odometry = cv::rgbd::ICPOdometry::create(intrinsics);
  const auto prepared = [&](const RgbdFrame& frame, int use) {
    const cv::Mat depth(c.height, c.width, CV_32F, const_cast<float*>(frame.depth.data()));
    cv::Ptr<cv::rgbd::OdometryFrame> result = cv::rgbd::OdometryFrame::create(cv::Mat(), depth.clone(), depth > 0);
    odometry->prepareFrameCache(result, use);
    return result;
  };
  cv::Ptr<cv::rgbd::OdometryFrame> from = prepared(scene.frame, cv::rgbd::OdometryFrame::CACHE_SRC);
  cv::Ptr<cv::rgbd::OdometryFrame> to = prepared(scene.neighbour, cv::rgbd::OdometryFrame::CACHE_DST);
  const Pose T_world_neighbour = scene.T_world_neighbour;
  return {"opencv_rgbd_icp", threads, [=](const Pose& start) mutable {
            cv::setNumThreads(threads);
            const Eigen::Matrix4d guess = (T_world_neighbour.inverse() * start).matrix();
            cv::Mat initial(4, 4, CV_64F), found;
            for (int i = 0; i < 16; ++i) initial.at<double>(i / 4, i % 4) = guess(i / 4, i % 4);
            if (!odometry->compute(from, to, found, initial)) return start;
            Pose motion = Pose::Identity();
            for (int i = 0; i < 12; ++i) motion.matrix()(i / 4, i % 4) = found.at<double>(i / 4, i % 4);
            return renormalized(T_world_neighbour * motion);
          }};
}
#endif

void compete(std::vector<Contender>& contenders, const AlignmentScene& scene, int rounds) {
  const std::vector<Pose> starts = starts_around(scene.T_world_camera, kFar);
  for (int round = 0; round < rounds; ++round)
    for (Contender& c : contenders) {
      const Pose& start = starts[static_cast<std::size_t>(round) % starts.size()];
      const auto began = std::chrono::steady_clock::now();
      const std::clock_t ticks = std::clock();
      const Pose found = c.align(start);
      c.processor_ms.push_back(1e3 * static_cast<double>(std::clock() - ticks) / CLOCKS_PER_SEC);
      c.wall_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count());
      c.error.add(pose_error(found, scene.T_world_camera));
    }
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

void run(int rounds) {
  WorkerPool pool(2);
  const AlignmentScene scene = make_alignment_scene(pool);
  const GridTarget map(scene.target), frame(neighbour_points(scene));
  std::vector<Contender> contenders;
  for (const int threads : {1, 2}) contenders.push_back(tracker("langgs_to_map", threads, scene, map));
#ifdef LANGGS_WITH_PCL
  contenders.push_back(pcl_gicp(scene));
#endif
  for (const int threads : {1, 2}) contenders.push_back(tracker("langgs_to_frame", threads, scene, frame));
#ifdef LANGGS_WITH_RGBD
  for (const int threads : {1, 2}) contenders.push_back(rgbd_icp(scene, threads));
#endif
  compete(contenders, scene, rounds);

  std::printf("%d points; %d Gaussians of the map, %d of the neighbouring frame; %d rounds\n",
              scene.source.num_trackable(), map.size(), frame.size(), rounds);
  std::printf("%-16s %7s %8s %12s %8s %8s\n", "medians", "threads", "wall ms", "processor ms", "mm", "mrad");
  for (const Contender& c : contenders)
    std::printf("%-16s %7d %8.2f %12.2f %8.2f %8.2f\n", c.name.c_str(), c.threads, median(c.wall_ms),
                median(c.processor_ms), c.error.rms().translation_mm, c.error.rms().rotation_mrad);
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 40;
  if (argc > 2 || rounds < 1) {
    std::fprintf(stderr, "Usage: peers [ROUNDS]  (default: 40)\n");
    return 2;
  }
  langgs::benchmarks::run(rounds);
  return 0;
}
