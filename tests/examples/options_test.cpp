// SPDX-License-Identifier: Apache-2.0
#include "common/options.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <string>
#include <vector>

#include "common/class_vectors.hpp"
#include "common/pipeline.hpp"
#include "langgs/core/error.hpp"
#include "langgs/io/npy.hpp"
#include "langgs/slam/settings.hpp"
#include "temporary_folder.hpp"

using namespace langgs;
using namespace langgs::examples;

namespace {

RunOptions parse(std::vector<const char*> words) {
  words.insert(words.begin(), {"langgs_slam", "--output", "out"});
  return parse_options(static_cast<int>(words.size()), words.data());
}

}  // namespace

TEST_CASE("Defaults and values") {
  const RunOptions o = parse({});
  CHECK(o.dataset.kind == "synthetic");
  CHECK(o.features == "labels");
  CHECK(o.iterations == 10);
  CHECK(o.threads >= 1);
  const RunOptions tum =
      parse({"--dataset", "tum", "--input", "x", "--top-k", "5", "--features=npy:maps", "--seed", "7"});
  CHECK(tum.features == "npy:maps");
  CHECK(tum.top_k == 5);
  CHECK(tum.seed == 7);
  CHECK(parse({"--dataset", "tum"}).features == "none");
  CHECK(to_json(tum)["seed"] == 7);
  CHECK_FALSE(to_json(parse({"--features", "none"})).contains("feature-dim"));
}

TEST_CASE("The depth sensor decides how points are weighed") {
  const SourceCloudSettings structured = slam_settings(parse({})).tracking.source;
  CHECK(structured.noise_z == SourceCloudSettings{}.noise_z);
  CHECK(structured.noise_z2 == SourceCloudSettings{}.noise_z2);
  const SourceCloudSettings tof = slam_settings(parse({"--depth-sensor", "time-of-flight"})).tracking.source;
  CHECK(tof.noise_z == time_of_flight().noise_z);
  CHECK(tof.noise_z2 == 0);
  CHECK_THROWS_AS(parse({"--depth-sensor", "lidar"}), InvalidArgument);
}

TEST_CASE("--device cuda says how to build for it where it is not compiled in") {
  CHECK(parse({}).device == "host");
  if (has_cuda())
    CHECK(parse({"--device", "cuda"}).device == "cuda");
  else
    CHECK_THROWS_WITH_AS(parse({"--device", "cuda"}), doctest::Contains("-DLANGGS_ENABLE_CUDA=ON"), InvalidArgument);
}

TEST_CASE("Wrong options give one line") {
  const std::vector<std::vector<const char*>> wrong = {{"--dataset", "kitti"},
                                                       {"--iterations", "-5"},
                                                       {"--iterations", "many"},
                                                       {"--top-k", "0"},
                                                       {"--top-k", "17"},
                                                       {"--features", "npy:"},
                                                       {"--features", "clip"},
                                                       {"--mode", "fast"},
                                                       {"--fps", "30"},
                                                       {"--resume", "map"},
                                                       {"--hold-out", "1"},
                                                       {"--threads", "0"},
                                                       {"--unknown"},
                                                       {"--input", "x"},
                                                       {"--dataset", "tum", "--width", "64"},
                                                       {"--mode", "realtime", "--iterations", "5"},
                                                       {"--mode", "realtime", "--hold-out", "4"},
                                                       {"--features", "none", "--feature-dim", "16"},
                                                       {"--features", "texture", "--class-features", "x.npy"},
                                                       {"--colour-noise", "nan"},
                                                       {"--stride", "99999999999"},
                                                       {"--features", "none", "--top-k", "5"}};
  for (const auto& words : wrong) {
    CAPTURE(std::string(words[0]));
    CAPTURE(std::string(words.back()));
    const std::string message = error_of([&] { (void)parse(words); });
    CHECK(message.size() > 10);
    CHECK(message.find('\n') == std::string::npos);
  }
  const char* nothing[] = {"langgs_slam"};
  CHECK_THROWS_AS((void)parse_options(1, nothing), InvalidArgument);
  CHECK_THROWS_AS((void)parse({"--help"}), HelpRequested);
}

TEST_CASE("Class vectors become unit rows by label") {
  const TemporaryFolder folder;
  const std::string file = (folder.path / "classes.npy").string();
  RunOptions o = parse(
      {"--features", "labels", "--class-features", file.c_str(), "--width", "16", "--height", "16", "--frames", "1"});
  const auto room = open_dataset(o.dataset);
  const std::size_t labels = room->class_names().size();
  const std::vector<float> values(labels * 16, 2.f);

  write_npy(file, {labels, 16}, values.data());
  std::vector<float> vectors = load_class_vectors(o, *room);
  CHECK(o.feature_dim == 16);
  REQUIRE(vectors.size() == labels * 16);
  CHECK(vectors[0] == 0);  // label 0 means nothing
  CHECK(vectors[16] == doctest::Approx(0.25));

  write_npy(file, {labels - 1, 16}, values.data());  // without label 0
  CHECK(load_class_vectors(o, *room) == vectors);

  write_npy(file, {labels - 2, 16}, values.data());
  CHECK(error_of([&] { (void)load_class_vectors(o, *room); }).find("a row for each label") != std::string::npos);
  write_npy(file, {labels * 16}, values.data());
  CHECK_THROWS_AS((void)load_class_vectors(o, *room), IoError);
  std::vector<float> bad = values;
  bad[40] = std::numeric_limits<float>::quiet_NaN();
  write_npy(file, {labels, 16}, bad.data());
  CHECK_THROWS_AS((void)load_class_vectors(o, *room), IoError);
  o.feature_dim = 64;
  write_npy(file, {labels, 16}, values.data());
  CHECK(error_of([&] { (void)load_class_vectors(o, *room); }).find("--feature-dim is 64") != std::string::npos);
  o.class_features = folder.path / "missing.npy";
  CHECK_THROWS_AS((void)load_class_vectors(o, *room), IoError);
}
