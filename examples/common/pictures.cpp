// SPDX-License-Identifier: Apache-2.0
#include "common/pictures.hpp"

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>

#include "common/colours.hpp"
#include "common/image_files.hpp"
#include "common/trajectory_plot.hpp"
#include "langgs/core/error.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

namespace {

constexpr int kGap = 6;           // between panels [px]
constexpr int kPanelWidth = 320;  // of a strip; the overview's are smaller
const cv::Scalar kPaper(250, 250, 250), kInk(40, 40, 40), kSoft(120, 120, 120);

struct Panel {
  std::string title;
  cv::Mat picture;
};

/// One view: what was measured beside what the map shows.
struct Strip {
  std::string caption;
  std::vector<Panel> panels;
};

void put_text(cv::Mat& image, const std::string& text, cv::Point at, double size, const cv::Scalar& colour) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_DUPLEX, size, colour, 1, cv::LINE_AA);
}

cv::Mat resized(const cv::Mat& picture, int width) {
  cv::Mat result;
  const int height = std::max(1, picture.rows * width / picture.cols);
  cv::resize(picture, result, {width, height}, 0, 0, width < picture.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

void paste(cv::Mat& sheet, const cv::Mat& picture, int x, int y) {
  picture.copyTo(sheet(cv::Rect(x, y, picture.cols, picture.rows)));
}

/// Robust range of the measured depths.
std::pair<float, float> depth_range(const Image<float>& depth) {
  std::vector<float> valid;
  for (std::size_t i = 0; i < depth.size(); ++i)
    if (depth.data()[i] > 0) valid.push_back(depth.data()[i]);
  if (valid.empty()) return {0.f, 1.f};
  std::sort(valid.begin(), valid.end());
  return {valid[valid.size() / 50], valid[valid.size() - 1 - valid.size() / 50]};
}

Strip make_strip(Pipeline& pipeline, const PictureInput& input, const EvaluatedView& view,
                 const FeatureColours& feature_colours) {
  const Camera camera = input.dataset.camera();
  const RgbdFrame frame = input.dataset.frame(view.dataset_frame);
  const RenderedImages rendered = pipeline.render(camera, view.T_world_camera);
  const auto [near, far] = depth_range(frame.depth);
  Strip strip;
  strip.caption = detail::concat(view.held_out ? "held out: " : "keyframe: ", "frame ", view.dataset_frame);
  strip.panels = {{"input", picture_of(frame.colour)},
                  {"map: colour", picture_of(rendered.colour)},
                  {"input depth", depth_picture(frame.depth, near, far)},
                  {"map: depth", depth_picture(rendered.depth, near, far)}};
  if (input.feature_dim > 1) {
    constexpr int kMaxSide = 240;  // a full image of 512 values per pixel takes gigabytes
    const int shrink = std::max(1, (std::max(camera.width, camera.height) + kMaxSide - 1) / kMaxSide);
    const int width = std::max(1, camera.width / shrink), height = std::max(1, camera.height / shrink);
    const std::vector<float> features = pipeline.feature_image(camera, view.T_world_camera, width, height);
    cv::Mat picture;
    cv::resize(feature_colours.picture(features, width, height), picture, {camera.width, camera.height}, 0, 0,
               cv::INTER_LINEAR);
    strip.panels.push_back({"map: features (PCA)", picture});
  }
  if (!input.class_vectors.empty()) {
    strip.panels.push_back(
        {"map: labels", label_picture(pipeline.label_image(camera, view.T_world_camera, input.class_vectors))});
    if (input.dataset.has_labels())
      strip.panels.push_back({"true labels", label_picture(input.dataset.labels(view.dataset_frame))});
  }
  return strip;
}

cv::Mat strip_picture(const Strip& strip) {
  constexpr int kHeader = 52;
  const int count = static_cast<int>(strip.panels.size());
  const int height = resized(strip.panels[0].picture, kPanelWidth).rows;
  cv::Mat sheet(kHeader + height + kGap, count * (kPanelWidth + kGap) + kGap, CV_8UC3, kPaper);
  put_text(sheet, strip.caption, {kGap, 20}, 0.5, kInk);
  for (int i = 0; i < count; ++i) {
    const int x = kGap + i * (kPanelWidth + kGap);
    put_text(sheet, strip.panels[i].title, {x, kHeader - 10}, 0.45, kSoft);
    paste(sheet, resized(strip.panels[i].picture, kPanelWidth), x, kHeader);
  }
  return sheet;
}

/// The classes of the shown label pictures, most frequent first, as swatches with names.
cv::Mat legend(const PictureInput& input, int width, int height) {
  cv::Mat sheet(height, width, CV_8UC3, kPaper);
  const std::vector<std::string> names = input.dataset.class_names();
  std::map<int, std::size_t> counts;
  for (const EvaluatedView& view : input.views) {
    const Image<std::uint16_t> labels = input.dataset.labels(view.dataset_frame);
    for (std::size_t i = 0; i < labels.size(); ++i) ++counts[labels.data()[i]];
  }
  counts.erase(0);
  std::vector<std::pair<std::size_t, int>> order;
  for (const auto& [label, count] : counts) order.push_back({count, label});
  std::sort(order.begin(), order.end(),
            [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a.second < b.second; });
  constexpr int kRow = 22, kColumn = 170;
  const int rows = std::max(1, (height - 30) / kRow);
  if (!order.empty()) put_text(sheet, "classes in these views", {0, 18}, 0.45, kSoft);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const int x = static_cast<int>(i) / rows * kColumn, y = 30 + static_cast<int>(i) % rows * kRow;
    if (x + kColumn > width) break;
    const int label = order[i].second;
    cv::rectangle(sheet, cv::Rect(x, y, 14, 14), cv::Scalar(label_colour(label)), cv::FILLED);
    const bool named = label < static_cast<int>(names.size()) && !names[label].empty();
    put_text(sheet, (named ? names[label] : std::to_string(label)).substr(0, 18), {x + 20, y + 12}, 0.42, kInk);
  }
  return sheet;
}

cv::Mat overview_picture(const PictureInput& input, const std::vector<Strip>& strips) {
  constexpr int kMargin = 16, kHeader = 74, kTitles = 24, kFooter = 260;
  const int columns = static_cast<int>(strips[0].panels.size());
  const int panel_width = columns <= 4 ? 300 : 240;
  const int panel_height = resized(strips[0].panels[0].picture, panel_width).rows;
  const int width = 2 * kMargin + columns * (panel_width + kGap) - kGap;
  const int rows_height = static_cast<int>(strips.size()) * (panel_height + kGap);
  cv::Mat sheet(kHeader + kTitles + rows_height + kFooter + kMargin, width, CV_8UC3, kPaper);
  put_text(sheet, input.title, {kMargin, 34}, 0.8, kInk);
  put_text(sheet, input.subtitle, {kMargin, 60}, 0.48, kSoft);
  for (int c = 0; c < columns; ++c)
    put_text(sheet, strips[0].panels[c].title, {kMargin + c * (panel_width + kGap), kHeader + kTitles - 8}, 0.48, kInk);
  for (std::size_t r = 0; r < strips.size(); ++r) {
    const int y = kHeader + kTitles + static_cast<int>(r) * (panel_height + kGap);
    for (int c = 0; c < columns; ++c)
      paste(sheet, resized(strips[r].panels[c].picture, panel_width), kMargin + c * (panel_width + kGap), y);
    // The caption on a dark band, readable over any picture.
    cv::Mat band = sheet(cv::Rect(kMargin, y + panel_height - 20, panel_width, 20));
    band = band * 0.35;
    put_text(band, strips[r].caption, {6, 14}, 0.42, cv::Scalar::all(245));
  }
  const int footer = kHeader + kTitles + rows_height + kGap;
  const int plot_width = std::min(420, width / 2 - kMargin);
  const bool labels = !input.class_vectors.empty() && input.dataset.has_labels();
  if (labels) paste(sheet, legend(input, width - plot_width - 3 * kMargin, kFooter - kGap), kMargin, footer);
  paste(sheet, trajectory_picture(input.trajectory, input.dataset.reference(), plot_width, kFooter - kGap),
        labels ? width - plot_width - kMargin : kMargin, footer);
  return sheet;
}

/// Pictures of an earlier run would be taken for this one's.
void remove_old_pictures(const fs::path& folder) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    const bool ours = name == "overview.png" || (name.starts_with("frame_") && name.ends_with(".png"));
    if (ours) fs::remove(entry.path(), ignored);
  }
}

}  // namespace

std::vector<EvaluatedView> views_to_show(const std::vector<EvaluatedView>& views) {
  std::vector<EvaluatedView> shown;
  for (const bool held_out : {false, true}) {
    std::vector<EvaluatedView> kind;
    for (const EvaluatedView& view : views)
      if (view.held_out == held_out) kind.push_back(view);
    const std::size_t wanted = std::min<std::size_t>(kind.size(), held_out ? 2 : 4);
    // The middles of equal parts: the ends of a sequence often show little.
    for (std::size_t i = 0; i < wanted; ++i) shown.push_back(kind[(2 * i + 1) * kind.size() / (2 * wanted)]);
  }
  return shown;
}

std::vector<fs::path> write_pictures(Pipeline& pipeline, const PictureInput& input, const fs::path& folder) {
  remove_old_pictures(folder);
  if (input.views.empty()) return {};
  constexpr int kSamples = 4000;
  const FeatureColours feature_colours(
      input.feature_dim > 1 ? pipeline.feature_samples(kSamples) : std::vector<float>{},
      std::max(1, input.feature_dim));
  std::vector<fs::path> paths = {folder / "overview.png"};
  std::vector<Strip> strips;
  for (const EvaluatedView& view : input.views) {
    strips.push_back(make_strip(pipeline, input, view, feature_colours));
    char name[64];
    std::snprintf(name, sizeof(name), "frame_%06d_%s.png", view.dataset_frame, view.held_out ? "held_out" : "keyframe");
    paths.push_back(folder / name);
    write_png(paths.back(), strip_picture(strips.back()));
  }
  write_png(paths.front(), overview_picture(input, strips));
  return paths;
}

}  // namespace langgs::examples
