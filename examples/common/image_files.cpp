// SPDX-License-Identifier: Apache-2.0
#include "common/image_files.hpp"

#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/io/atomic_file.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxImageBytes = std::uint64_t{1} << 28;

/// Decodes a file as it is stored. OpenCV returns a partly filled image for a truncated PNG or JPEG and only prints a
/// warning, so the end of the file is checked first.
cv::Mat decode(const fs::path& path, const Camera& camera) {
  const std::string bytes = read_file(path, kMaxImageBytes);
  const auto ends_with = [&](std::string_view mark, std::size_t slack) {
    return bytes.size() > 16 && bytes.rfind(mark) != std::string::npos &&
           bytes.rfind(mark) + mark.size() + slack >= bytes.size();
  };
  const bool is_png = bytes.starts_with("\x89PNG\r\n\x1a\n"), is_jpeg = bytes.starts_with("\xff\xd8\xff");
  if (!is_png && !is_jpeg)
    detail::raise<IoError>(path.string(), " is neither PNG nor JPEG (", bytes.size(),
                           " bytes); copy it again or remove its line from the list");
  // The checksum follows IEND; some cameras pad their JPEGs.
  if (is_png ? !ends_with("IEND", 4) : !ends_with("\xff\xd9", 4096))
    detail::raise<IoError>(path.string(), " is truncated after ", bytes.size(),
                           " bytes; copy it again or remove its line from the list");
  cv::Mat image;
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    image = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty())
    detail::raise<IoError>(path.string(), " cannot be decoded; copy it again or remove its line from the list");
  if (image.cols != camera.width || image.rows != camera.height)
    detail::raise<IoError>(path.string(), " is ", image.cols, "x", image.rows, " but the calibration says ",
                           camera.width, "x", camera.height, "; correct the calibration or convert the images");
  return image;
}

}  // namespace

Image<std::uint8_t> read_colour(const fs::path& path, const Camera& camera) {
  cv::Mat image = decode(path, camera);
  if (image.depth() != CV_8U || (image.channels() != 3 && image.channels() != 1 && image.channels() != 4))
    detail::raise<IoError>(path.string(), " has ", 8 * image.elemSize1(), " bits and ", image.channels(),
                           " channels; a colour image needs 8 bits and 1, 3 or 4 channels");
  const int code = image.channels() == 1   ? cv::COLOR_GRAY2RGB
                   : image.channels() == 3 ? cv::COLOR_BGR2RGB
                                           : cv::COLOR_BGRA2RGB;
  cv::cvtColor(image, image, code);
  Image<std::uint8_t> result(image.cols, image.rows, 3);
  for (int y = 0; y < image.rows; ++y)
    std::memcpy(&result(0, y), image.ptr(y), static_cast<std::size_t>(image.cols) * 3);
  return result;
}

Image<float> read_depth(const fs::path& path, const Camera& camera, double depth_scale) {
  const cv::Mat image = decode(path, camera);
  if (image.type() != CV_16UC1)
    detail::raise<IoError>(path.string(), " has ", 8 * image.elemSize1(), " bits and ", image.channels(),
                           " channels; a depth image needs 16 bits and one channel");
  constexpr std::uint16_t kSaturated = 65535;
  Image<float> result(image.cols, image.rows);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      const std::uint16_t value = image.at<std::uint16_t>(y, x);
      result(x, y) = value == kSaturated ? 0.f : static_cast<float>(value / depth_scale);
    }
  return result;
}

Image<std::uint16_t> read_labels(const fs::path& path, const Camera& camera) {
  const cv::Mat image = decode(path, camera);
  if (image.type() != CV_8UC1 && image.type() != CV_16UC1)
    detail::raise<IoError>(path.string(), " has ", 8 * image.elemSize1(), " bits and ", image.channels(),
                           " channels; a label image needs 8 or 16 bits and one channel");
  Image<std::uint16_t> result(image.cols, image.rows);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      result(x, y) = image.depth() == CV_8U ? image.at<std::uint8_t>(y, x) : image.at<std::uint16_t>(y, x);
  return result;
}

void write_png(const fs::path& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", image, bytes))
    detail::raise<IoError>("cannot encode ", path.string(), "; is OpenCV built with PNG support?");
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace langgs::examples
