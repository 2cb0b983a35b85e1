// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/eval/association.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/frame/synthetic_room.hpp"

namespace langgs::examples {

/// A recorded or simulated sequence, in any order of access and from any thread.
class Dataset {
 public:
  virtual ~Dataset() = default;

  [[nodiscard]] virtual Camera camera() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  [[nodiscard]] virtual double timestamp(int i) const = 0;
  /// Colour, depth and time of frame i, without a pose. Throws IoError for files that cannot be used.
  [[nodiscard]] virtual RgbdFrame frame(int i) const = 0;
  /// A word for frame i that files beside it may carry, such as "000012".
  [[nodiscard]] virtual std::string name(int i) const = 0;

  /// The reference trajectory, empty without one. For evaluation, and for mapping with given poses.
  [[nodiscard]] virtual std::vector<StampedPose> reference() const { return {}; }

  [[nodiscard]] virtual bool has_labels() const { return false; }
  /// True class of every pixel [H, W], 0 where undefined.
  [[nodiscard]] virtual Image<std::uint16_t> labels(int) const { return {}; }
  /// Names by label, from 0 on; empty where unknown.
  [[nodiscard]] virtual std::vector<std::string> class_names() const { return {}; }
  /// Unit vectors [number of names, dim] that the data set brings itself, row 0 zeros; empty without any.
  [[nodiscard]] virtual std::vector<float> class_vectors(int) const { return {}; }

  /// What it is and which calibration is in force, for people.
  [[nodiscard]] virtual std::string description() const = 0;
};

struct DatasetOptions {
  std::string kind = "synthetic";  ///< synthetic, tum or replica; both of the latter take either folder layout
  std::filesystem::path input;
  std::string distortion = "auto";
  std::string depth_delay = "auto";
  double max_gap = 0.08;  ///< between the time stamps of a colour and its depth image [s]
  SyntheticRoomSettings room;
  int num_threads = 1;  ///< that draw the synthetic room
};

/// Opens a data set and reads its first frame, so that unusable ones are found at once. Throws IoError or
/// InvalidArgument.
[[nodiscard]] std::unique_ptr<Dataset> open_dataset(const DatasetOptions& options);

/// The reference pose at a time, interpolated between neighbours at most `max_gap` [s] away; nothing where there is
/// none. `reference` must be sorted by time.
[[nodiscard]] std::optional<Pose> pose_at(const std::vector<StampedPose>& reference, double timestamp, double max_gap);

// The kinds of data sets; open_dataset chooses.

[[nodiscard]] std::unique_ptr<Dataset> make_synthetic_dataset(const DatasetOptions& options);
/// rgb.txt, depth.txt, optional groundtruth.txt, calibration.txt, class/NAME.png and classes.txt.
[[nodiscard]] std::unique_ptr<Dataset> make_tum_dataset(const DatasetOptions& options);
/// results/frame*.jpg and depth*.png, or images/ and depth_images/; optional traj.txt and cam_params.json.
[[nodiscard]] std::unique_ptr<Dataset> make_replica_dataset(const DatasetOptions& options);

}  // namespace langgs::examples
