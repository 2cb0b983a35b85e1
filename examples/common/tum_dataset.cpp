// SPDX-License-Identifier: Apache-2.0
#include "common/image_dataset.hpp"
#include "langgs/core/error.hpp"
#include "langgs/io/association.hpp"
#include "langgs/io/tum_trajectory.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

std::unique_ptr<Dataset> make_tum_dataset(const DatasetOptions& options) {
  const fs::path& folder = options.input;
  const std::vector<TumListEntry> colour = read_tum_list(folder / "rgb.txt"),
                                  depth = read_tum_list(folder / "depth.txt");
  const auto stamps = [](const std::vector<TumListEntry>& entries) {
    std::vector<double> result;
    for (const TumListEntry& entry : entries) result.push_back(entry.timestamp);
    return result;
  };
  const double delay = choose_depth_delay(options.depth_delay, folder);
  std::vector<FrameFiles> files;
  for (const StampPair& pair : associate(stamps(colour), stamps(depth), options.max_gap))
    files.push_back({colour[pair.first].timestamp, folder / colour[pair.first].filename,
                     folder / depth[pair.second].filename,
                     depth[pair.second].timestamp - delay - colour[pair.first].timestamp});
  if (files.empty())
    detail::raise<IoError>(folder.string(), ": no colour image of rgb.txt has a depth image of depth.txt within ",
                           options.max_gap, " s; check the time stamps or raise --max-gap");
  std::vector<StampedPose> reference;
  if (fs::exists(folder / "groundtruth.txt")) reference = read_tum_trajectory(folder / "groundtruth.txt");
  return std::make_unique<ImageDataset>(options, tum_calibration(folder), std::move(files), std::move(reference));
}

}  // namespace langgs::examples
