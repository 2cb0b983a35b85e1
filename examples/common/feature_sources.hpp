// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <unordered_map>
#include <vector>

#include "common/dataset.hpp"
#include "common/options.hpp"
#include "langgs/core/error.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/frame/label_features.hpp"
#include "langgs/frame/texture_features.hpp"
#include "langgs/io/npy.hpp"

namespace langgs::examples {

/// Any FeatureSource, chosen at run time.
template <int D>
using FeatureFunction = std::function<FeatureMap<D>(const RgbdFrame&)>;

/// Which frame of the data set a frame is, by its time.
class FrameFinder {
 public:
  explicit FrameFinder(const Dataset& dataset) {
    for (int i = dataset.size() - 1; i >= 0; --i) index_[dataset.timestamp(i)] = i;
  }
  [[nodiscard]] int operator()(const RgbdFrame& frame) const { return index_.at(frame.timestamp); }

 private:
  std::unordered_map<double, int> index_;
};

/// Reads NAME.npy of a folder: [H, W, D], or [D, H, W] if `channels_first`. Throws IoError for a file that is missing
/// or of another shape.
template <int D>
[[nodiscard]] FeatureMap<D> read_feature_map(const std::filesystem::path& path, bool channels_first) {
  const NpyArray array = read_npy(path);
  const std::size_t channel_axis = channels_first ? 0 : 2;
  constexpr std::size_t kMaxSide = 16384;
  const auto shape = [&] {
    std::string text;
    for (const std::size_t extent : array.shape) text += (text.empty() ? "" : ", ") + std::to_string(extent);
    return text;
  };
  if (array.shape.size() != 3 || array.shape[channel_axis] != D)
    detail::raise<IoError>(path.string(), " has shape [", shape(), "], expected ",
                           channels_first ? "[D, H, W]" : "[H, W, D]", " with D = ", D,
                           "; correct --feature-dim or --npy-layout");
  const std::size_t height = array.shape[channels_first ? 1 : 0], width = array.shape[channels_first ? 2 : 1];
  if (height < 1 || width < 1 || height > kMaxSide || width > kMaxSide)
    detail::raise<IoError>(path.string(), " has shape [", shape(), "]; sides must be in [1, ", kMaxSide, "]");
  const std::vector<float> values = to_float(array);
  FeatureMap<D> map(static_cast<int>(width), static_cast<int>(height));
  std::vector<float> pixel(D);
  for (std::size_t y = 0; y < height; ++y)
    for (std::size_t x = 0; x < width; ++x) {
      for (std::size_t c = 0; c < D; ++c)
        pixel[c] = channels_first ? values[(c * height + y) * width + x] : values[(y * width + x) * D + c];
      map.set_pixel(static_cast<int>(x), static_cast<int>(y), pixel.data());
    }
  return map;
}

/// The source that --features asks for. The data set must outlive it.
template <int D>
[[nodiscard]] FeatureFunction<D> make_features(const RunOptions& options, const Dataset& dataset,
                                               const std::vector<float>& class_vectors) {
  if constexpr (D > 1) {
    const FrameFinder find(dataset);
    if (options.features == "labels") {
      LabelFeatureSettings settings;
      settings.stride = settings.blur = options.feature_stride;
      return LabelFeatures<D>{[&dataset, find](const RgbdFrame& frame) { return dataset.labels(find(frame)); },
                              class_vectors, settings};
    }
    if (options.features == "texture") {
      TextureFeatureSettings settings;
      settings.stride = options.feature_stride;
      return TextureFeatures<D>(settings);
    }
    if (options.features.starts_with("npy:")) {
      const std::filesystem::path folder = options.features.substr(4);
      const bool channels_first = options.npy_layout == "dhw";
      return [&dataset, find, folder, channels_first](const RgbdFrame& frame) {
        return read_feature_map<D>(folder / (dataset.name(find(frame)) + ".npy"), channels_first);
      };
    }
  }
  (void)options, (void)dataset, (void)class_vectors;
  return [](const RgbdFrame&) { return FeatureMap<D>{}; };
}

}  // namespace langgs::examples
