// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/geometric_loss.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "langgs/core/rng.hpp"
#include "reference/central_difference.hpp"
#include "reference/naive_loss.hpp"

using namespace langgs;

namespace {

using FloatBuffer = Buffer<float, Host>;

/// Random images with some unmeasured pixels; rendered and target differ by at least 0.01 so that no difference
/// quotient straddles the kink of the L1 terms.
struct Scene {
  int width, height;
  FloatBuffer rendered_colour, rendered_depth, target_colour, target_depth;

  Scene(int w, int h, std::uint64_t seed, double unmeasured = 0.2) : width(w), height(h) {
    const int n = w * h;
    const CounterRng rng{seed, 1}, other{seed, 2};
    const auto apart = [&](int i) {
      const double offset = 0.4 * (other.uniform(i) - 0.5);
      return offset + (offset < 0 ? -0.01 : 0.01);
    };
    rendered_colour.resize_discard(3 * n), target_colour.resize_discard(3 * n);
    rendered_depth.resize_discard(n), target_depth.resize_discard(n);
    for (int i = 0; i < 3 * n; ++i) {
      target_colour.data()[i] = static_cast<float>(rng.uniform(i));
      rendered_colour.data()[i] = static_cast<float>(target_colour.data()[i] + apart(i));
    }
    for (int i = 0; i < n; ++i) {
      const double depth = 0.5 + 4 * rng.uniform(1'000'000 + i);
      target_depth.data()[i] = rng.uniform(2'000'000 + i) < unmeasured ? 0.f : static_cast<float>(depth);
      rendered_depth.data()[i] = static_cast<float>(depth + apart(1'000'000 + i));
    }
  }
  [[nodiscard]] ImageView rendered() const { return {rendered_colour.data(), rendered_depth.data(), width, height}; }
  [[nodiscard]] ImageView target() const { return {target_colour.data(), target_depth.data(), width, height}; }
  [[nodiscard]] int num_pixels() const { return width * height; }
};

struct Gradient {
  FloatBuffer colour, depth;
  explicit Gradient(int n) : colour(3 * n), depth(n) {
    colour.fill(std::numeric_limits<float>::quiet_NaN());  // the loss must overwrite every element
    depth.fill(std::numeric_limits<float>::quiet_NaN());
  }
  [[nodiscard]] ImageGradientView view() { return {colour.data(), depth.data()}; }
};

reference::NaiveImages naive(const Scene& s, bool colour, bool masked) {
  reference::NaiveImages images{s.width, s.height, colour ? 3 : 1, {}, {}, {}};
  const FloatBuffer& r = colour ? s.rendered_colour : s.rendered_depth;
  const FloatBuffer& t = colour ? s.target_colour : s.target_depth;
  images.rendered.assign(r.data(), r.data() + r.size());
  images.target.assign(t.data(), t.data() + t.size());
  images.mask.assign(s.num_pixels(), 1.0);
  for (int i = 0; i < s.num_pixels() && masked; ++i) images.mask[i] = s.target_depth.data()[i] > 0 ? 1 : 0;
  return images;
}

template <class Backend>
std::vector<float> evaluate(const Executor<Backend>& executor, const Scene& scene, double& value) {
  GeometricLoss<Backend> loss;
  Gradient gradient(scene.num_pixels());
  value = loss.evaluate(executor, scene.rendered(), scene.target(), gradient.view());
  std::vector<float> all(gradient.colour.data(), gradient.colour.data() + gradient.colour.size());
  all.insert(all.end(), gradient.depth.data(), gradient.depth.data() + gradient.depth.size());
  return all;
}

}  // namespace

TEST_CASE("geometric loss: terms agree with the naive double-precision definition at awkward sizes") {
  const Executor<Host> executor(2);
  GeometricLoss<> loss;  // one object for all sizes, growing and shrinking: no size may see another's leftovers
  const int sizes[][2] = {{1, 1},  {70, 23}, {31, 5},   {32, 11},  {27, 12}, {3, 70},
                          {33, 2}, {59, 40}, {123, 45}, {54, 161}, {56, 330}};
  for (const auto& size : sizes) {
    CAPTURE(size[0]);
    CAPTURE(size[1]);
    const Scene scene(size[0], size[1], 7);
    Gradient gradient(scene.num_pixels());
    const double total = loss.evaluate(executor, scene.rendered(), scene.target(), gradient.view());
    const double l1 = reference::naive_l1(naive(scene, true, true));
    const double dssim = reference::naive_dssim(naive(scene, true, true));
    const double depth = reference::naive_l1(naive(scene, false, true));
    CHECK(loss.terms().l1 == doctest::Approx(l1).epsilon(1e-6));
    CHECK(loss.terms().dssim == doctest::Approx(dssim).epsilon(2e-6));
    CHECK(loss.terms().depth == doctest::Approx(depth).epsilon(1e-6));
    CHECK(total == doctest::Approx(0.8 * l1 + 0.2 * dssim + 0.1 * depth).epsilon(1e-6));
  }
}

TEST_CASE("geometric loss: gradient agrees with central differences of the naive definition") {
  const struct {
    int width, height;
    bool masked;
  } cases[] = {{21, 17, true}, {21, 17, false}, {57, 9, true}, {7, 165, true}};  // the last two: two strips
  for (const auto& one : cases) {
    const bool masked = one.masked;
    CAPTURE(one.width);
    CAPTURE(masked);
    const Scene scene(one.width, one.height, 3);
    const GeometricLossWeights weights{0.35f, 0.7f, masked};
    GeometricLoss<> loss(weights);
    Gradient gradient(scene.num_pixels());
    loss.evaluate(Executor<Host>(2), scene.rendered(), scene.target(), gradient.view());

    reference::NaiveImages colour = naive(scene, true, masked), depth = naive(scene, false, true);
    const CounterRng rng{5, 5};
    double worst = 0, worst_depth = 0;
    for (int k = 0; k < 60; ++k) {
      const auto i = rng.below(k, static_cast<std::uint32_t>(colour.rendered.size()));
      const double expected = reference::central_difference(
          [&] {
            return (1 - static_cast<double>(weights.ssim)) * reference::naive_l1(colour) +
                   static_cast<double>(weights.ssim) * reference::naive_dssim(colour);
          },
          colour.rendered[i], 1e-3);
      worst = std::max(worst, std::abs(static_cast<double>(gradient.colour.data()[i]) - expected));
    }
    for (int i = 0; i < scene.num_pixels(); ++i) {
      const double expected = reference::central_difference(
          [&] { return static_cast<double>(weights.depth) * reference::naive_l1(depth); }, depth.rendered[i], 1e-3);
      worst_depth = std::max(worst_depth, std::abs(static_cast<double>(gradient.depth.data()[i]) - expected));
    }
    const double unit = 1.0 / (3 * scene.num_pixels());  // magnitude of a gradient element
    CHECK(worst / unit < 1e-4);
    CHECK(worst_depth / unit < 1e-5);
  }
}

TEST_CASE("geometric loss: equal images give zero loss and zero gradient") {
  Scene scene(45, 30, 11);
  std::memcpy(scene.rendered_colour.data(), scene.target_colour.data(), 3 * scene.num_pixels() * sizeof(float));
  std::memcpy(scene.rendered_depth.data(), scene.target_depth.data(), scene.num_pixels() * sizeof(float));
  double value = 1;
  const std::vector<float> gradient = evaluate(Executor<Host>(1), scene, value);
  CHECK(std::abs(value) < 1e-6);
  for (const float g : gradient) CHECK(std::abs(g) * 3 * static_cast<float>(scene.num_pixels()) < 1e-3f);
}

TEST_CASE("geometric loss: flat images far from random ones keep a finite gradient") {
  Scene scene(40, 40, 2, 0.0);
  scene.target_colour.fill(1.f);
  scene.rendered_colour.fill(0.f);
  double value = 0;
  for (const float g : evaluate(Executor<Host>(1), scene, value)) REQUIRE(std::isfinite(g));
  CHECK(std::isfinite(value));
}

TEST_CASE("geometric loss: unmeasured, infinite and NaN depth is masked, whatever was rendered there") {
  Scene scene(37, 19, 4);
  for (const float bad : {0.f, -1.f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    scene.target_depth.data()[100] = bad;
    scene.rendered_depth.data()[100] = std::numeric_limits<float>::quiet_NaN();
    for (int p = 0; p < 3; ++p)
      scene.rendered_colour.data()[p * scene.num_pixels() + 100] = std::numeric_limits<float>::quiet_NaN();
    double value = 0;
    const std::vector<float> gradient = evaluate(Executor<Host>(1), scene, value);
    CHECK(std::isfinite(value));
    for (const float g : gradient) REQUIRE(std::isfinite(g));
    for (int p = 0; p < 4; ++p) CHECK(gradient[p * scene.num_pixels() + 100] == 0);
  }
}

TEST_CASE("geometric loss: the same bits for any number of threads and any order") {
  const Scene scene(160, 97, 9);
  double expected_value = 0;
  const std::vector<float> expected = evaluate(Executor<Host>(1), scene, expected_value);
  const auto same = [&](const std::vector<float>& gradient) {
    return std::memcmp(gradient.data(), expected.data(), expected.size() * sizeof(float)) == 0;
  };
  for (const int threads : {2, 5}) {
    double value = 0;
    CHECK(same(evaluate(Executor<Host>(threads), scene, value)));
    CHECK(value == expected_value);
  }
  for (const ExecutionOrder order : {ExecutionOrder::descending, ExecutionOrder::shuffled}) {
    Executor<CheckedHost> executor(1);
    executor.order = order;
    double value = 0;
    CHECK(same(evaluate(executor, scene, value)));
    CHECK(value == expected_value);
  }
}

TEST_CASE("geometric loss: mistakes are named") {
  const Scene scene(8, 8, 1);
  Gradient gradient(64);
  GeometricLoss<> loss;
  const Executor<Host> executor(1);
  ImageView other = scene.target();
  other.width = 4;
  CHECK_THROWS_AS(loss.evaluate(executor, scene.rendered(), other, gradient.view()), InvalidArgument);
  other = scene.target();
  other.depth = nullptr;
  CHECK_THROWS_AS(loss.evaluate(executor, scene.rendered(), other, gradient.view()), InvalidArgument);
  CHECK_THROWS_AS(loss.evaluate(executor, scene.rendered(), scene.target(), {}), InvalidArgument);
  CHECK_THROWS_AS(loss.evaluate(executor, ImageView{}, ImageView{}, gradient.view()), InvalidArgument);
  CHECK_THROWS_AS(GeometricLoss<>({.ssim = 1.5f}), InvalidArgument);
  CHECK_THROWS_AS(GeometricLoss<>({.depth = -1.f}), InvalidArgument);
  CHECK_THROWS_AS(GeometricLoss<>({.ssim = std::nanf("")}), InvalidArgument);
}
