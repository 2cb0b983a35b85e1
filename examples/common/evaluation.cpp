// SPDX-License-Identifier: Apache-2.0
#include "common/evaluation.hpp"

#include <algorithm>

#include "langgs/eval/image_metrics.hpp"

namespace langgs::examples {

namespace {

/// A mean that knows whether it has seen anything.
struct Mean {
  double sum = 0;
  int count = 0;
  void add(std::optional<double> value) {
    if (!value) return;
    sum += *value;
    ++count;
  }
  [[nodiscard]] std::optional<double> get() const {
    return count > 0 ? std::optional<double>(sum / count) : std::nullopt;
  }
};

struct ViewScores {
  Mean psnr_valid_depth, psnr_all, ssim, depth_l1;
  int views = 0;

  void add(const RenderedImages& rendered, const RgbdFrame& frame) {
    const Image<float> measured = unit_colours(frame.colour);
    psnr_valid_depth.add(langgs::psnr_valid_depth(rendered.colour, measured, frame.depth));
    psnr_all.add(langgs::psnr_all(rendered.colour, measured));
    ssim.add(ssim_11_gauss(rendered.colour, measured));
    depth_l1.add(langgs::depth_l1(rendered.depth, frame.depth));
    ++views;
  }
  [[nodiscard]] ImageScore score() const {
    return {views, psnr_valid_depth.get(), psnr_all.get(), ssim.get(), depth_l1.get()};
  }
};

LabelImage as_labels(const Image<std::uint16_t>& image) {
  LabelImage labels(image.width(), image.height());
  std::copy_n(image.data(), image.size(), labels.data());
  return labels;
}

}  // namespace

Image<float> unit_colours(const Image<std::uint8_t>& colour) {
  Image<float> result(colour.width(), colour.height(), colour.channels());
  for (std::size_t i = 0; i < colour.size(); ++i) result.data()[i] = static_cast<float>(colour.data()[i]) / 255.f;
  return result;
}

Evaluation evaluate(Pipeline& pipeline, const EvaluationInput& input, const std::function<bool(int, int)>& progress) {
  Evaluation result;
  const std::vector<StampedPose> reference = input.dataset.reference();
  if (input.ate && !reference.empty()) {
    try {
      result.ate = ate_umeyama_se3(input.trajectory, reference);
    } catch (const InvalidArgument&) {
      // Fewer than three pairs: not measured, therefore absent.
    }
  }
  const Camera camera = input.dataset.camera();
  const bool semantic = !input.class_vectors.empty() && input.dataset.has_labels();
  const ConfusionMatrix empty = labels_full(semantic ? input.num_labels : 1, true);
  ConfusionMatrix confusion[2] = {empty, empty};  // of keyframes and of held-out views
  ViewScores scores[2];
  int done = 0;
  for (const EvaluatedView& view : input.views) {
    const RgbdFrame frame = input.dataset.frame(view.dataset_frame);
    scores[view.held_out].add(pipeline.render(camera, view.T_world_camera), frame);
    if (semantic)
      confusion[view.held_out].add(as_labels(input.dataset.labels(view.dataset_frame)),
                                   as_labels(pipeline.label_image(camera, view.T_world_camera, input.class_vectors)));
    if (!progress(++done, static_cast<int>(input.views.size()))) break;
  }
  result.keyframes = scores[0].score();
  result.held_out = scores[1].score();
  if (semantic) {
    result.semantic_keyframes = confusion[0].score();
    result.semantic_held_out = confusion[1].score();
  }
  result.teacher_cosine = pipeline.teacher_cosine();
  return result;
}

}  // namespace langgs::examples
