// SPDX-License-Identifier: Apache-2.0
#include "common/class_vectors.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "langgs/core/error.hpp"
#include "langgs/io/npy.hpp"

namespace langgs::examples {

namespace {

/// Reads [rows, D], makes the rows unit vectors indexed by label, and row 0 zeros.
std::vector<float> read_class_features(const std::filesystem::path& path, int num_labels, int& dim) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;
  constexpr std::size_t kMaxLabels = 65536;
  const NpyArray array = read_npy(path, kMaxBytes);
  if (array.shape.size() != 2 || array.shape[0] < 1 || array.shape[1] < 1 || array.shape[0] > kMaxLabels)
    detail::raise<IoError>(path.string(), " has ", array.shape.size(), " axes and ", array.size(),
                           " values; class features need the shape [classes, D]");
  const std::size_t rows = array.shape[0], d = array.shape[1];
  if (dim != 0 && static_cast<std::size_t>(dim) != d)
    detail::raise<IoError>(path.string(), " has vectors of ", d, " values but --feature-dim is ", dim,
                           "; leave --feature-dim out to take the file's");
  dim = static_cast<int>(d);
  const std::size_t labels = num_labels > 0 ? static_cast<std::size_t>(num_labels) : rows;
  if (rows != labels && rows + 1 != labels)
    detail::raise<IoError>(path.string(), " has ", rows, " rows but the data set has labels 0 to ", labels - 1,
                           "; give a row for each label, with or without label 0");
  std::vector<float> vectors = to_float(array);
  if (rows + 1 == labels) vectors.insert(vectors.begin(), d, 0.f);
  for (std::size_t row = 0; row < labels; ++row) {
    float* v = vectors.data() + row * d;
    double norm2 = 0;
    for (std::size_t c = 0; c < d; ++c) norm2 += static_cast<double>(v[c]) * v[c];
    if (!std::isfinite(norm2))
      detail::raise<IoError>(path.string(), ": the vector of label ", row, " is not finite; correct the file");
    const double scale = row > 0 && norm2 > 0 ? 1 / std::sqrt(norm2) : 0;
    for (std::size_t c = 0; c < d; ++c) v[c] = static_cast<float>(v[c] * scale);
  }
  return vectors;
}

}  // namespace

std::vector<float> load_class_vectors(RunOptions& options, const Dataset& dataset) {
  constexpr int kDefaultDim = 512;  // LSeg, CLIP ViT-B/32
  std::vector<float> vectors;
  if (!options.class_features.empty())
    vectors = read_class_features(options.class_features, static_cast<int>(dataset.class_names().size()),
                                  options.feature_dim);
  if (options.has_features() && options.feature_dim == 0) options.feature_dim = kDefaultDim;
  if (options.features != "labels") return vectors;
  LANGGS_EXPECTS(dataset.has_labels(), "--features labels: ", options.dataset.input.string(),
                 " has no label images class/NAME.png; use --features texture or npy:DIR");
  if (vectors.empty()) vectors = dataset.class_vectors(options.feature_dim);
  LANGGS_EXPECTS(!vectors.empty(), "--features labels: the data set brings no vectors for its classes; give ",
                 "--class-features FILE.npy [classes, D]");
  const Image<std::uint16_t> first = dataset.labels(0);
  const std::size_t highest = *std::max_element(first.data(), first.data() + first.size());
  const std::size_t rows = vectors.size() / static_cast<std::size_t>(options.feature_dim);
  LANGGS_EXPECTS(highest < rows, "--class-features: label ", highest,
                 " occurs in the images but there are vectors for ", rows,
                 " labels, from 0 on; give a row for each label");
  return vectors;
}

}  // namespace langgs::examples
