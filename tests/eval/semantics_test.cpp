// SPDX-License-Identifier: Apache-2.0
#include "langgs/eval/semantics.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "langgs/eval/agreement_f3dgs.hpp"

using namespace langgs;

namespace {

LabelImage labels4x4(std::initializer_list<int> values) {
  LabelImage image(4, 4);
  std::copy(values.begin(), values.end(), image.data());
  return image;
}

const LabelImage kReference = labels4x4({0, 0, 1, 1,  //
                                         0, 0, 1, 1,  //
                                         2, 2, 2, 2,  //
                                         2, 2, 2, 3});
const LabelImage kPredicted = labels4x4({0, 0, 1, 1,  //
                                         0, 1, 1, 2,  //
                                         2, 2, 2, 2,  //
                                         2, 2, 4, 4});

}  // namespace

TEST_CASE("ConfusionMatrix: hand-counted 4x4 maps") {
  ConfusionMatrix matrix = agreement_full(6);
  matrix.add(kReference, kPredicted);
  CHECK(matrix.count(0, 1) == 1);
  CHECK(matrix.count(2, 2) == 6);
  CHECK(matrix.count(3, 4) == 1);
  CHECK(*matrix.iou(0) == 3.0 / 4);
  CHECK(*matrix.iou(1) == 3.0 / 5);
  CHECK(*matrix.iou(2) == 6.0 / 8);
  CHECK(*matrix.iou(3) == 0.0);
  CHECK(*matrix.iou(4) == 0.0);
  CHECK_FALSE(matrix.iou(5).has_value());
  const SemanticScore score = *matrix.score();
  CHECK(score.accuracy == 12.0 / 16);
  CHECK(score.mean_iou == doctest::Approx((0.75 + 0.6 + 0.75 + 0 + 0) / 5));  // class 5 occurs nowhere
}

TEST_CASE("ConfusionMatrix: one matrix for the data set, not a mean over images") {
  LabelImage tiny(1, 1, 1, 5);
  ConfusionMatrix matrix = agreement_full(6);
  matrix.add(kReference, kPredicted);
  matrix.add(tiny, tiny);
  CHECK(matrix.score()->accuracy == doctest::Approx(13.0 / 17));
  CHECK(matrix.score()->mean_iou == doctest::Approx((0.75 + 0.6 + 0.75 + 0 + 0 + 1) / 6));
}

TEST_CASE("ConfusionMatrix: the ignored label") {
  ConfusionMatrix matrix = labels_full(5, true);
  matrix.add(kReference, kPredicted);
  CHECK(matrix.score()->accuracy == 9.0 / 12);  // the four pixels of label 0 are out
  CHECK(*matrix.iou(1) == 3.0 / 4);             // and so is the one that was predicted 1 there
  CHECK_FALSE(matrix.iou(0).has_value());
  matrix.add(kPredicted, kReference);  // here 0 is predicted once where 1 is true: a miss of 1
  CHECK(*matrix.iou(1) == 6.0 / 9);
  CHECK(labels_full(5, false).score() == std::nullopt);

  ConfusionMatrix outside(2, 255);
  LabelImage a(3, 1), b(3, 1);
  a(0, 0) = 255, a(1, 0) = 1;
  b(2, 0) = 255, b(1, 0) = 1;
  outside.add(a, b);
  CHECK(outside.score()->accuracy == 0.5);
  CHECK(*outside.iou(0) == 0.0);
  CHECK(outside.score()->mean_iou == 0.5);
}

TEST_CASE("ConfusionMatrix: bad labels and sizes change nothing") {
  ConfusionMatrix matrix(4);
  CHECK_THROWS_AS(matrix.add(kReference, kPredicted), InvalidArgument);  // label 4
  CHECK_THROWS_AS(matrix.add(kReference, LabelImage(4, 3)), InvalidArgument);
  CHECK_THROWS_AS(matrix.add(LabelImage(1, 1, 1, -1), LabelImage(1, 1)), InvalidArgument);
  CHECK_FALSE(matrix.score().has_value());
  CHECK_THROWS_AS(ConfusionMatrix(0), InvalidArgument);
  CHECK_THROWS_AS(ConfusionMatrix(1 << 20), InvalidArgument);
  CHECK_THROWS_AS((void)matrix.iou(4), InvalidArgument);
}

TEST_CASE("argmax: first of equals, NaN never") {
  const float nan = std::nanf("");
  CHECK(argmax(std::vector<float>{1, 3, 3, 2}) == 1);
  CHECK(argmax(std::vector<float>{nan, -2, nan, -1}) == 3);
  CHECK(argmax(std::vector<float>{nan, nan}) == 0);
  CHECK(argmax({}) == 0);
  Image<float> scores(2, 1, 3);
  scores(0, 0, 2) = 1;
  scores(1, 0, 1) = 1;
  const LabelImage labels = argmax_labels(scores);
  CHECK(labels(0, 0) == 2);
  CHECK(labels(1, 0) == 1);
}

TEST_CASE("agreement_f3dgs: hand-counted 4x4 maps, mean over the most frequent labels") {
  F3dgsProtocol protocol;
  // Counts in both: 2: 8+... = 15, 1: 8, 0: 7, 4: 2, 3: 1; their IoUs are 6/8, 3/5, 3/4, 0, 0.
  CHECK(agreement_f3dgs(kReference, kPredicted).accuracy == 12.0 / 16);
  CHECK(agreement_f3dgs(kReference, kPredicted).mean_iou == doctest::Approx((0.75 + 0.6 + 0.75) / 5));
  protocol.num_labels = 3;
  CHECK(agreement_f3dgs(kReference, kPredicted, protocol).mean_iou == doctest::Approx((0.75 + 0.6 + 0.75) / 3));
  protocol.num_labels = 2;
  CHECK(agreement_f3dgs(kReference, kPredicted, protocol).mean_iou == doctest::Approx((0.75 + 0.6) / 2));
  CHECK(agreement_f3dgs(kReference, kPredicted, protocol).accuracy == 12.0 / 16);
  CHECK_THROWS_AS((void)agreement_f3dgs(kReference, LabelImage(3, 4)), InvalidArgument);
  CHECK_THROWS_AS((void)agreement_f3dgs(LabelImage(), LabelImage()), InvalidArgument);
  protocol.num_labels = 0;
  CHECK_THROWS_AS((void)agreement_f3dgs(kReference, kPredicted, protocol), InvalidArgument);
}

TEST_CASE("agreement_f3dgs: only seven labels count; of equally frequent ones the lower") {
  // Ten labels, two pixels each in both maps; labels 0 to 4 agree, 5 to 9 are swapped in the student.
  LabelImage teacher(10, 2), student(10, 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 10; ++x) {
      teacher(x, y) = x;
      student(x, y) = x < 5 ? x : 14 - x;  // 7 stays
    }
  CHECK(agreement_f3dgs(teacher, student).accuracy == 0.6);
  CHECK(agreement_f3dgs(teacher, student).mean_iou == doctest::Approx(5.0 / 7));  // labels 0 to 6
}

TEST_CASE("f3dgs_labels: small images keep their size before the nearest resize") {
  Image<float> scores(10, 6, 4);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 10; ++x) scores(x, y, (x * 3 + y) % 4) = 1;
  F3dgsProtocol protocol;
  protocol.label_width = 7, protocol.label_height = 5;
  const LabelImage labels = f3dgs_labels(scores, 480, protocol);
  REQUIRE(labels.width() == 7);
  REQUIRE(labels.height() == 5);
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 7; ++i) CHECK(labels(i, j) == ((i * 10 / 7) * 3 + j * 6 / 5) % 4);
  CHECK(f3dgs_labels(scores, 480).width() == 159);
  CHECK(f3dgs_labels(scores, 480).height() == 119);
}

TEST_CASE("f3dgs_labels: maps of wide images are resized bilinearly with aligned corners, then merged") {
  // Scores that are linear in x: label 0 left of the place where x / (W - 1) = 0.4, label 1 right of it.
  Image<float> scores(700, 8, 2);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 700; ++x) {
      scores(x, y, 0) = 0.4f;
      scores(x, y, 1) = static_cast<float>(x) / 699.f;
    }
  F3dgsProtocol protocol;
  protocol.label_merges = {{1, 9}, {9, 5}};
  const LabelImage labels = f3dgs_labels(scores, 481, protocol);
  for (int i = 0; i < 159; ++i) {
    const double position = (i * 480 / 159) / 479.0;
    if (std::abs(position - 0.4) > 1e-5) CHECK(labels(i, 60) == (position > 0.4 ? 5 : 0));
  }
  // The map's own size does not decide: a low-resolution map of a wide image is interpolated too.
  Image<float> coarse(2, 2, 2);
  for (int y = 0; y < 2; ++y) {
    coarse(0, y, 0) = coarse(1, y, 0) = 0.4f;
    coarse(1, y, 1) = 1;
  }
  CHECK(f3dgs_labels(coarse, 481, protocol) == labels);
  CHECK(f3dgs_labels(coarse, 480, protocol)(100, 3) == 5);
}

TEST_CASE("f3dgs_labels: scores of resized features equal resized scores") {
  constexpr int kDim = 6, kPrompts = 5;
  Image<float> features(9, 7, kDim);
  float prompts[kPrompts][kDim];
  for (std::size_t i = 0; i < features.size(); ++i)
    features.data()[i] = static_cast<float>(std::sin(37.0 * static_cast<double>(i * i) + 1));
  for (int p = 0; p < kPrompts; ++p)
    for (int d = 0; d < kDim; ++d) prompts[p][d] = static_cast<float>(std::cos(11.0 * p + d * d));
  const auto score = [&](const float* feature) {
    std::vector<float> scores(kPrompts);
    for (int p = 0; p < kPrompts; ++p)
      for (int d = 0; d < kDim; ++d) scores[p] += prompts[p][d] * feature[d];
    return scores;
  };
  Image<float> scores(9, 7, kPrompts);
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 9; ++x) {
      const auto s = score(&features(x, y));
      std::copy(s.begin(), s.end(), &scores(x, y));
    }
  const auto read = [&](int x, int y, float* out) { std::memcpy(out, &features(x, y), kDim * sizeof(float)); };
  const PixelMap<decltype(read)> map{9, 7, kDim, read};
  const LabelImage a = f3dgs_labels(map, 640, [&](const float* feature) { return argmax(score(feature)); });
  const LabelImage b = f3dgs_labels(scores, 640);
  int different = 0;  // rounding may decide on a border
  for (std::size_t i = 0; i < a.size(); ++i) different += a.data()[i] != b.data()[i];
  CHECK(different < 10);
  CHECK_THROWS_AS((void)f3dgs_labels(Image<float>(), 640), InvalidArgument);
  CHECK_THROWS_AS((void)f3dgs_labels(scores, 0), InvalidArgument);
}

TEST_CASE("mean_score") {
  const std::vector<SemanticScore> scores = {{0.5, 0.25}, {1.0, 0.75}};
  CHECK(mean_score(scores)->accuracy == 0.75);
  CHECK(mean_score(scores)->mean_iou == 0.5);
  CHECK_FALSE(mean_score({}).has_value());
}
