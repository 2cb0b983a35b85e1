// SPDX-License-Identifier: Apache-2.0
#include "common/dataset.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "common/image_files.hpp"
#include "langgs/core/error.hpp"
#include "temporary_folder.hpp"

using namespace langgs;
using namespace langgs::examples;
namespace fs = std::filesystem;

namespace {

constexpr int kWidth = 16, kHeight = 12;
const Camera kCamera{20, 20, 7.5f, 5.5f, kWidth, kHeight};

void write_images(const fs::path& colour, const fs::path& depth, std::uint16_t value) {
  fs::create_directories(colour.parent_path());
  fs::create_directories(depth.parent_path());
  cv::Mat bgr(kHeight, kWidth, CV_8UC3, cv::Scalar(10, 20, 30));
  cv::Mat metres(kHeight, kWidth, CV_16U, cv::Scalar(value));
  metres.at<std::uint16_t>(0, 0) = 65535;
  metres.at<std::uint16_t>(0, 1) = 0;
  cv::imwrite(colour.string(), bgr);
  cv::imwrite(depth.string(), metres);
}

/// Three frames in the layout of TUM; the second colour image has no depth image near enough.
struct TumFolder : TemporaryFolder {
  TumFolder() {
    write("rgb.txt", "# colour\n1.00 rgb/a.png\n2.00 rgb/b.png\n3.00 rgb/c.png\n");
    write("depth.txt", "1.02 depth/a.png\n2.50 depth/b.png\n2.99 depth/c.png\n");
    write("calibration.txt", "# fx fy ...\n20 20 7.5 5.5 16 12 1000\n");
    for (const char* name : {"a", "b", "c"})
      write_images(path / "rgb" / (std::string(name) + ".png"), path / "depth" / (std::string(name) + ".png"),
                   static_cast<std::uint16_t>(1000 * (name[0] - 'a' + 1)));
  }
  [[nodiscard]] DatasetOptions options() const {
    DatasetOptions o;
    o.kind = "tum";
    o.input = path;
    return o;
  }
  /// The message of the error that opening the folder ends with.
  [[nodiscard]] std::string error() const {
    return error_of([&] { (void)open_dataset(options()); });
  }
};

bool holds(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("A TUM folder: association, colours, depths") {
  const TumFolder folder;
  const auto dataset = open_dataset(folder.options());
  REQUIRE(dataset->size() == 2);
  CHECK(dataset->camera() == kCamera);
  CHECK(dataset->name(1) == "c");
  CHECK(dataset->timestamp(1) == 3.0);
  const RgbdFrame frame = dataset->frame(1);
  CHECK(frame.timestamp == 3.0);
  CHECK_FALSE(frame.T_world_camera);
  CHECK(frame.colour(5, 5, 0) == 30);  // red: OpenCV stores blue first
  CHECK(frame.colour(5, 5, 2) == 10);
  CHECK(frame.depth(5, 5) == 3.f);
  CHECK(frame.depth(0, 0) == 0.f);  // 65535 is no measurement
  CHECK(frame.depth(1, 0) == 0.f);
  CHECK(dataset->reference().empty());
  CHECK_FALSE(dataset->has_labels());
}

TEST_CASE("The option 'replica' takes the same folder, and the gap is an option") {
  const TumFolder folder;
  DatasetOptions options = folder.options();
  options.kind = "replica";
  options.max_gap = 0.6;
  CHECK(open_dataset(options)->size() == 3);
  options.max_gap = 0.001;
  CHECK_THROWS_AS((void)open_dataset(options), IoError);
}

TEST_CASE("Labels and class names beside the images") {
  const TumFolder folder;
  cv::Mat labels(kHeight, kWidth, CV_8U, cv::Scalar(7));
  fs::create_directories(folder.path / "class");
  cv::imwrite((folder.path / "class" / "a.png").string(), labels);
  folder.write("classes.txt", "# id name\n0 undefined\n7 coffee table\n3 chair\n");
  const auto dataset = open_dataset(folder.options());
  CHECK(dataset->has_labels());
  CHECK(dataset->labels(0)(3, 3) == 7);
  CHECK_THROWS_AS((void)dataset->labels(1), IoError);
  REQUIRE(dataset->class_names().size() == 8);
  CHECK(dataset->class_names()[7] == "coffee table");
  CHECK(dataset->class_names()[4].empty());
}

TEST_CASE("Reference poses are read and interpolated") {
  const TumFolder folder;
  folder.write("groundtruth.txt", "1.02 2 0 0 0 0 0 1\n0.98 1 0 0 0 0 0 1\n");
  const auto reference = open_dataset(folder.options())->reference();
  REQUIRE(reference.size() == 2);
  CHECK(reference[0].timestamp == 0.98);
  CHECK(pose_at(reference, 1.0, 0.08)->translation().x() == doctest::Approx(1.5));
  CHECK(pose_at(reference, 1.02, 0.08)->translation().x() == 2);
  CHECK(pose_at(reference, 1.05, 0.08)->translation().x() == 2);
  CHECK_FALSE(pose_at(reference, 1.2, 0.08));
  CHECK_FALSE(pose_at({}, 1.2, 0.08));
}

TEST_CASE("Distortion is removed from colour and depth alike") {
  const TumFolder folder;
  folder.write("calibration.txt", "20 20 7.5 5.5 16 12 1000 2 0 0 0 0\n");
  const auto dataset = open_dataset(folder.options());
  CHECK(holds(dataset->description(), "(removed)"));
  const RgbdFrame frame = dataset->frame(0);
  CHECK(frame.colour(15, 11, 0) == 0);  // the corner was not seen
  CHECK(frame.depth(15, 11) == 0.f);
  CHECK(frame.colour(8, 6, 0) == 30);
  DatasetOptions options = folder.options();
  options.distortion = "none";
  CHECK(open_dataset(options)->frame(0).colour(15, 11, 0) == 30);
}

TEST_CASE("Broken TUM folders say what is wrong") {
  TumFolder folder;
  SUBCASE("no folder") {
    DatasetOptions options = folder.options();
    options.input = folder.path / "nothing";
    CHECK(holds(error_of([&] { (void)open_dataset(options); }), "is not a folder"));
  }
  SUBCASE("empty list") {
    folder.write("rgb.txt", "# nothing\n");
    CHECK(holds(folder.error(), "lists no files"));
  }
  SUBCASE("no list") {
    fs::remove(folder.path / "depth.txt");
    CHECK(holds(folder.error(), "depth.txt"));
  }
  SUBCASE("missing image") {
    fs::remove(folder.path / "rgb" / "c.png");
    CHECK(holds(folder.error(), "c.png is missing"));
  }
  SUBCASE("no calibration") {
    fs::remove(folder.path / "calibration.txt");
    CHECK(holds(folder.error(), "fx fy cx cy width height depth_scale"));
  }
  SUBCASE("wrong size") {
    folder.write("calibration.txt", "20 20 7.5 5.5 32 24 1000\n");
    CHECK(holds(folder.error(), "is 16x12 but the calibration says 32x24"));
  }
  SUBCASE("truncated image") {
    fs::resize_file(folder.path / "rgb" / "a.png", fs::file_size(folder.path / "rgb" / "a.png") / 2);
    CHECK(holds(folder.error(), "truncated"));
  }
  SUBCASE("empty image") {
    folder.write("rgb/a.png", "");
    CHECK(holds(folder.error(), "neither PNG nor JPEG"));
  }
  SUBCASE("image with damaged contents") {
    std::fstream file(folder.path / "rgb" / "a.png", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(20);
    file.write("\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff", 12);
    file.close();
    CHECK(holds(folder.error(), "a.png"));
  }
  SUBCASE("depth that is not 16 bits") {
    fs::copy_file(folder.path / "rgb" / "a.png", folder.path / "depth" / "a.png", fs::copy_options::overwrite_existing);
    CHECK(holds(folder.error(), "a depth image needs 16 bits and one channel"));
  }
  SUBCASE("colour that is not 8 bits") {
    fs::copy_file(folder.path / "depth" / "a.png", folder.path / "rgb" / "a.png", fs::copy_options::overwrite_existing);
    CHECK(holds(folder.error(), "a colour image needs 8 bits"));
  }
  SUBCASE("bad class names") {
    fs::create_directories(folder.path / "class");
    folder.write("classes.txt", "99999999 chair\n");
    CHECK(holds(folder.error(), "id in [0, 65535]"));
  }
}

TEST_CASE("Both Replica layouts") {
  const TemporaryFolder folder;
  DatasetOptions options;
  options.kind = "replica";
  options.input = folder.path;
  const std::string identity = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n", moved = "1 0 0 4 0 1 0 0 0 0 1 0 0 0 0 1\n";
  SUBCASE("results/") {
    for (const char* n : {"000000", "000001"})
      write_images(folder.path / "results" / (std::string("frame") + n + ".png"),
                   folder.path / "results" / (std::string("depth") + n + ".png"), 6554);
  }
  SUBCASE("images/ and depth_images/") {
    for (const char* n : {"0", "1"})
      write_images(folder.path / "images" / (std::string(n) + ".png"),
                   folder.path / "depth_images" / (std::string(n) + ".png"), 6554);
  }
  folder.write("cam_params.json",
               R"({"camera": {"w": 16, "h": 12, "fx": 20, "fy": 20, "cx": 7.5, "cy": 5.5, "scale": 6554}})");
  folder.write("traj.txt", identity + moved + moved);
  const auto dataset = open_dataset(options);
  CHECK(dataset->size() == 2);
  CHECK(dataset->camera() == kCamera);
  CHECK(dataset->frame(1).depth(5, 5) == 1.f);
  CHECK(dataset->reference()[1].T_world_camera.translation().x() == 4);

  folder.write("traj.txt", identity);
  CHECK(holds(error_of([&] { (void)open_dataset(options); }), "1 poses but there is a frame number 1"));
  folder.write("traj.txt", identity + "1 0 0 4 0 2 0 0 0 0 1 0 0 0 0 1\n");
  CHECK(holds(error_of([&] { (void)open_dataset(options); }), "traj.txt:2"));
  folder.write("traj.txt", "");
  CHECK(holds(error_of([&] { (void)open_dataset(options); }), "no poses"));
  fs::remove(folder.path / "traj.txt");
  CHECK(open_dataset(options)->reference().empty());
  for (const char* json : {"", "[]", "{", R"({"camera": 1})", R"({"camera": {"w": "16"}})",
                           R"({"camera": {"w": 1e99, "h": 12, "fx": 20, "fy": 20, "cx": 7.5, "cy": 5.5, "scale": 1}})",
                           R"({"camera": {"w": 16, "h": 12, "fx": 20, "fy": 20, "cx": 7.5, "cy": 5.5, "scale": 0}})"}) {
    folder.write("cam_params.json", json);
    CHECK(holds(error_of([&] { (void)open_dataset(options); }), "cam_params.json"));
  }
}

TEST_CASE("A Replica folder without any frames") {
  const TemporaryFolder folder;
  DatasetOptions options;
  options.kind = "replica";
  options.input = folder.path;
  CHECK(holds(error_of([&] { (void)open_dataset(options); }), "neither results/ nor images/"));
  fs::create_directories(folder.path / "results");
  CHECK(holds(error_of([&] { (void)open_dataset(options); }), "no frame with both colour and depth"));
}

TEST_CASE("The synthetic data set hides its poses from the frames") {
  DatasetOptions options;
  options.room.width = 32;
  options.room.height = 24;
  options.room.frames = 5;
  const auto dataset = open_dataset(options);
  CHECK(dataset->size() == 5);
  CHECK_FALSE(dataset->frame(2).T_world_camera);
  CHECK(dataset->reference().size() == 5);
  CHECK(dataset->labels(4).width() == 32);
  CHECK(dataset->class_vectors(16).size() == dataset->class_names().size() * 16);
  CHECK_THROWS_AS((void)dataset->frame(5), InvalidArgument);
}
