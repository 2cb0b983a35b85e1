// SPDX-License-Identifier: Apache-2.0
#include "common/colours.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "langgs/core/rng.hpp"

namespace langgs::examples {

namespace {

std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(value > 0 ? (value < 1 ? value * 255 + 0.5f : 255.f) : 0.f);  // NaN becomes 0
}

/// The part of `v` [dim] that is a unit vector's worth; false for a zero vector.
bool normalise(const float* v, int dim, std::vector<double>& out) {
  double norm2 = 0;
  for (int c = 0; c < dim; ++c) norm2 += static_cast<double>(v[c]) * v[c];
  if (!(norm2 > 1e-20) || !std::isfinite(norm2)) return false;
  for (int c = 0; c < dim; ++c) out[c] = v[c] / std::sqrt(norm2);
  return true;
}

}  // namespace

cv::Mat picture_of(const Image<std::uint8_t>& rgb) {
  cv::Mat picture(rgb.height(), rgb.width(), CV_8UC3);
  for (int y = 0; y < rgb.height(); ++y)
    for (int x = 0; x < rgb.width(); ++x) picture.at<cv::Vec3b>(y, x) = {rgb(x, y, 2), rgb(x, y, 1), rgb(x, y, 0)};
  return picture;
}

cv::Mat picture_of(const Image<float>& rgb) {
  cv::Mat picture(rgb.height(), rgb.width(), CV_8UC3);
  for (int y = 0; y < rgb.height(); ++y)
    for (int x = 0; x < rgb.width(); ++x)
      picture.at<cv::Vec3b>(y, x) = {byte_of(rgb(x, y, 2)), byte_of(rgb(x, y, 1)), byte_of(rgb(x, y, 0))};
  return picture;
}

cv::Mat depth_picture(const Image<float>& depth, float near, float far) {
  cv::Mat nearness(depth.height(), depth.width(), CV_8U), picture;
  for (int y = 0; y < depth.height(); ++y)
    for (int x = 0; x < depth.width(); ++x)
      nearness.at<std::uint8_t>(y, x) = byte_of(1 - (depth(x, y) - near) / std::max(far - near, 1e-3f));
  cv::applyColorMap(nearness, picture, cv::COLORMAP_TURBO);
  for (int y = 0; y < depth.height(); ++y)
    for (int x = 0; x < depth.width(); ++x)
      if (!(depth(x, y) > 0.05f)) picture.at<cv::Vec3b>(y, x) = {45, 45, 45};
  return picture;
}

cv::Vec3b label_colour(int label) {
  if (label <= 0) return {45, 45, 45};
  // Hues a golden angle apart never come near each other for neighbouring labels; three tones tell the rest apart.
  constexpr double kGolden = 0.61803398875;
  constexpr std::array<std::pair<double, double>, 3> kTones = {{{0.62, 0.93}, {0.85, 0.72}, {0.40, 1.0}}};
  const double hue = std::fmod(label * kGolden, 1.0) * 6;
  const auto [saturation, value] = kTones[label % 3];
  const auto channel = [&, s = saturation, v = value](double n) {
    const double k = std::fmod(n + hue, 6.0);
    return static_cast<std::uint8_t>(255 * (v - v * s * std::clamp(std::min(k, 4 - k), 0.0, 1.0)) + 0.5);
  };
  return {channel(1), channel(3), channel(5)};
}

cv::Mat label_picture(const Image<std::uint16_t>& labels) {
  cv::Mat picture(labels.height(), labels.width(), CV_8UC3);
  for (int y = 0; y < labels.height(); ++y)
    for (int x = 0; x < labels.width(); ++x) picture.at<cv::Vec3b>(y, x) = label_colour(labels(x, y));
  return picture;
}

FeatureColours::FeatureColours(const std::vector<float>& samples, int dim)
    : dim_(dim), mean_(dim, 0.0), axes_(static_cast<std::size_t>(kAxes) * dim, 0.0) {
  std::vector<std::vector<double>> rows;
  std::vector<double> row(dim);
  for (std::size_t i = 0; i + dim <= samples.size(); i += dim)
    if (normalise(samples.data() + i, dim, row)) rows.push_back(row);
  if (rows.empty()) return;
  for (const auto& r : rows)
    for (int c = 0; c < dim; ++c) mean_[c] += r[c] / static_cast<double>(rows.size());
  for (auto& r : rows)
    for (int c = 0; c < dim; ++c) r[c] -= mean_[c];

  constexpr int kIterations = 25;  // colours need no digits
  std::vector<double> next(dim), values(rows.size());
  for (int axis = 0; axis < std::min(kAxes, dim); ++axis) {
    double* v = axes_.data() + static_cast<std::size_t>(axis) * dim;
    for (int c = 0; c < dim; ++c) v[c] = CounterRng{7, static_cast<std::uint64_t>(axis)}.normal(c);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      std::fill(next.begin(), next.end(), 0.0);
      for (const auto& r : rows) {
        double dot = 0;
        for (int c = 0; c < dim; ++c) dot += r[c] * v[c];
        for (int c = 0; c < dim; ++c) next[c] += dot * r[c];
      }
      for (int other = 0; other < axis; ++other) {  // stay orthogonal to the axes found before
        const double* o = axes_.data() + static_cast<std::size_t>(other) * dim;
        double dot = 0;
        for (int c = 0; c < dim; ++c) dot += o[c] * next[c];
        for (int c = 0; c < dim; ++c) next[c] -= dot * o[c];
      }
      double norm2 = 0;
      for (const double x : next) norm2 += x * x;
      const double scale = norm2 > 1e-30 ? 1 / std::sqrt(norm2) : 0;
      for (int c = 0; c < dim; ++c) v[c] = next[c] * scale;
    }
    for (std::size_t i = 0; i < rows.size(); ++i) {
      values[i] = 0;
      for (int c = 0; c < dim; ++c) values[i] += rows[i][c] * v[c];
    }
    std::sort(values.begin(), values.end());
    low_[axis] = static_cast<float>(values[values.size() / 50]);
    high_[axis] = static_cast<float>(values[values.size() - 1 - values.size() / 50]);
  }
}

bool FeatureColours::project(const float* feature, float* out) const {
  std::vector<double> unit(dim_);
  if (!normalise(feature, dim_, unit)) return false;
  for (int axis = 0; axis < kAxes; ++axis) {
    double dot = 0;
    for (int c = 0; c < dim_; ++c) dot += axes_[static_cast<std::size_t>(axis) * dim_ + c] * (unit[c] - mean_[c]);
    out[axis] = (static_cast<float>(dot) - low_[axis]) / std::max(high_[axis] - low_[axis], 1e-6f);
  }
  return true;
}

cv::Mat FeatureColours::picture(const std::vector<float>& features, int width, int height) const {
  cv::Mat picture(height, width, CV_8UC3, cv::Scalar::all(0));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      float rgb[kAxes];
      if (project(features.data() + (static_cast<std::size_t>(y) * width + x) * dim_, rgb))
        picture.at<cv::Vec3b>(y, x) = {byte_of(rgb[2]), byte_of(rgb[1]), byte_of(rgb[0])};
    }
  return picture;
}

}  // namespace langgs::examples
