// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "langgs/core/rng.hpp"
#include "langgs/frame/synthetic/scene.hpp"

/// @file Things that stand in the synthetic room. Every function builds one thing with its foot at `place`, facing -y.

namespace langgs::detail {

using Eigen::Vector3d;

/// Materials that several things share.
struct Palette {
  int light_wood, dark_wood, white, metal, black, fabric, fabric_dark, leaf, leaf_light, clay, shade, carton, paper;
};

inline void put_table(Scene& scene, const Palette& palette, const Vector3d& place, double yaw) {
  Placer table(scene, kTable, place, yaw);
  table.box({0, 0, 0.73}, {1.35, 0.8, 0.04}, palette.light_wood)
      .box({0, 0, 0.67}, {1.15, 0.6, 0.07}, palette.dark_wood);
  for (const double x : {-0.58, 0.58}) {
    for (const double y : {-0.31, 0.31}) table.frustum({x, y, 0}, 0.022, 0.71, palette.dark_wood, 1.35);
  }
}

inline void put_chair(Scene& scene, const Palette& palette, const Vector3d& place, double yaw) {
  Placer chair(scene, kChair, place, yaw);
  chair.box({0, 0, 0.45}, {0.42, 0.42, 0.045}, palette.fabric_dark);
  for (const double x : {-0.18, 0.18}) {
    chair.frustum({x, -0.18, 0}, 0.016, 0.43, palette.light_wood, 1.2);
    chair.box({x, 0.19, 0.47}, {0.035, 0.03, 0.94}, palette.light_wood);
  }
  for (const double z : {0.62, 0.75, 0.88}) chair.box({0, 0.19, z}, {0.34, 0.018, 0.07}, palette.light_wood);
}

inline void put_sofa(Scene& scene, const Palette& palette, const Vector3d& place, double yaw, double width) {
  Placer sofa(scene, kSofa, place, yaw);
  sofa.box({0, 0, 0.19}, {width, 0.82, 0.26}, palette.fabric).box({0, 0.33, 0.52}, {width, 0.2, 0.6}, palette.fabric);
  for (const double side : {-1.0, 1.0}) {
    sofa.box({side * (width / 2 - 0.09), -0.02, 0.36}, {0.2, 0.84, 0.52}, palette.fabric);
    sofa.ellipsoid({side * (width / 2 - 0.09), -0.02, 0.62}, {0.13, 0.44, 0.07}, palette.fabric);
    for (const double y : {-0.33, 0.33})
      sofa.frustum({side * (width / 2 - 0.12), y, 0}, 0.025, 0.07, palette.dark_wood);
  }
  const int seats = width > 1.4 ? 2 : 1;
  const double seat = (width - 0.4) / seats;
  for (int i = 0; i < seats; ++i) {
    sofa.box({-width / 2 + 0.2 + seat * (i + 0.5), -0.08, 0.385}, {seat - 0.02, 0.64, 0.14}, palette.fabric);
  }
}

inline void put_cushion(Scene& scene, int material, const Vector3d& place, double yaw) {
  const Eigen::Matrix3d lean = Eigen::AngleAxisd(-0.35, Vector3d::UnitX()).toRotationMatrix();
  Placer(scene, kCushion, place, yaw).ellipsoid({0, 0, 0.2}, {0.23, 0.09, 0.21}, material, lean);
}

/// A bookcase with `boards` open floors between closed sides; books and things come from put_books.
inline void put_shelf(Scene& scene, const Palette& palette, const Vector3d& place, double yaw, int boards) {
  Placer shelf(scene, kShelf, place, yaw);
  const double height = 0.38 * boards + 0.03;
  for (const double x : {-0.6, 0.6}) shelf.box({x, 0, height / 2}, {0.03, 0.3, height}, palette.dark_wood);
  shelf.box({0, 0.14, height / 2}, {1.2, 0.02, height}, palette.light_wood);
  for (int i = 0; i <= boards; ++i) shelf.box({0, -0.005, 0.38 * i + 0.015}, {1.17, 0.28, 0.03}, palette.dark_wood);
}

/// A row of upright books of seeded sizes and colours over `length` metres, the last ones leaning.
inline void put_books(Scene& scene, const Vector3d& place, double yaw, double length, std::uint64_t row) {
  const CounterRng rng{scene.seed, 500 + row};
  const Rgb kTones[8] = {{0.55f, 0.16f, 0.15f}, {0.2f, 0.32f, 0.5f},  {0.25f, 0.42f, 0.3f}, {0.78f, 0.6f, 0.28f},
                         {0.4f, 0.24f, 0.36f},  {0.7f, 0.66f, 0.58f}, {0.72f, 0.38f, 0.2f}, {0.22f, 0.45f, 0.5f}};
  Placer books(scene, kBook, place, yaw);
  double x = 0;
  for (int i = 0; x < length; ++i) {
    const std::uint64_t c = 8 * static_cast<std::uint64_t>(i);
    const double thickness = 0.026 + 0.034 * rng.uniform(c), height = 0.2 + 0.1 * rng.uniform(c + 1);
    const double depth = 0.15 + 0.06 * rng.uniform(c + 2);
    const Rgb tone = kTones[rng.below(c + 3, 8)] * static_cast<float>(0.75 + 0.4 * rng.uniform(c + 4));
    Material cover;
    cover.first = tone;
    cover.second = rng.uniform(c + 5) < 0.5 ? Rgb(cover.first * 0.8f) : Rgb{0.88f, 0.83f, 0.7f};
    cover.pattern = Pattern::kStripes;
    cover.period = 0.9 * height;
    cover.grain = 0.12f;
    cover.grain_length = 0.08;
    // Bands run across the spine: the book lies on its side in its own frame.
    Eigen::Matrix3d attitude;
    attitude << 0, 0, 1, 0, 1, 0, -1, 0, 0;
    const double lean = x + 0.12 > length ? 0.16 : 0;
    attitude = Eigen::AngleAxisd(-lean, Vector3d::UnitY()).toRotationMatrix() * attitude;
    const Vector3d centre{x + thickness / 2 + lean * height / 2, 0.08 - depth / 2, height / 2 + lean * 0.02};
    books.solid(Solid::kBox, centre, {height / 2, depth / 2, thickness / 2 - 0.0015}, scene.add_material(cover),
                attitude);
    x += thickness + lean * 0.1;
  }
}

inline void put_floor_lamp(Scene& scene, const Palette& palette, const Vector3d& place) {
  Placer(scene, kLamp, place)
      .frustum({0, 0, 0}, 0.15, 0.03, palette.black, 0.85)
      .frustum({0, 0, 0.03}, 0.013, 1.4, palette.metal)
      .frustum({0, 0, 1.36}, 0.21, 0.28, palette.shade, 0.62);
}

inline void put_plant(Scene& scene, const Palette& palette, const Vector3d& place, int num_leaves, double size) {
  Placer plant(scene, kPlant, place);
  plant.frustum({0, 0, 0}, 0.13 * size, 0.3 * size, palette.clay, 1.35);
  plant.frustum({0, 0, 0.3 * size}, 0.016 * size, 0.55 * size, palette.dark_wood, 0.6);
  for (int i = 0; i < num_leaves; ++i) {
    // The golden angle spreads leaves as plants do; lower ones hang further out.
    const double turn = 2.399963 * i, rise = (i + 0.5) / num_leaves;
    const double reach = size * (0.3 - 0.16 * rise), droop = 0.75 - 1.5 * rise;
    const Eigen::Matrix3d attitude = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix() *
                                     Eigen::AngleAxisd(droop, Vector3d::UnitY()).toRotationMatrix();
    const Vector3d centre{reach * std::cos(turn), reach * std::sin(turn), size * (0.5 + 0.5 * rise)};
    plant.ellipsoid(centre, size * Vector3d{0.24, 0.09, 0.018}, i % 3 ? palette.leaf : palette.leaf_light, attitude);
  }
}

inline void put_cabinet(Scene& scene, const Palette& palette, const Vector3d& place, double yaw) {
  Placer cabinet(scene, kCabinet, place, yaw);
  cabinet.box({0, 0, 0.38}, {1.3, 0.42, 0.72}, palette.light_wood)
      .box({0, 0, 0.75}, {1.34, 0.46, 0.03}, palette.dark_wood);
  for (const double x : {-0.42, 0.0, 0.42}) {
    for (const double z : {0.2, 0.54}) {
      cabinet.box({x, -0.215, z}, {0.39, 0.015, 0.31}, palette.white)
          .ellipsoid({x, -0.235, z + 0.08}, {0.022, 0.018, 0.022}, palette.metal);
    }
  }
}

/// A window in a wall (facing -y) with panes, frame and sill; `place` is the middle of its lower edge.
inline void put_window(Scene& scene, const Palette& palette, const Vector3d& place, double yaw) {
  Material sky;
  sky.first = {0.62f, 0.78f, 0.93f};
  sky.second = {0.9f, 0.95f, 0.99f};
  sky.pattern = Pattern::kSky;
  sky.period = 1.4;
  sky.grain = 0.06f;
  sky.grain_length = 0.4;
  sky.glows = true;
  Placer window(scene, kWindow, place, yaw);
  window.box({0, -0.01, 0.6}, {1.3, 0.02, 1.2}, scene.add_material(sky));
  for (const double x : {-0.65, 0.0, 0.65}) window.box({x, -0.03, 0.6}, {0.06, 0.06, 1.26}, palette.white);
  for (const double z : {0.0, 0.78, 1.2}) window.box({0, -0.03, z}, {1.3, 0.06, 0.06}, palette.white);
  window.box({0, -0.09, -0.05}, {1.5, 0.2, 0.035}, palette.white);
}

/// Folds of cloth: a row of slim columns of alternating depth.
inline void put_curtain(Scene& scene, int material, const Vector3d& place, double yaw, int folds) {
  Placer curtain(scene, kCurtain, place, yaw);
  for (int i = 0; i < folds; ++i) {
    const double x = 0.07 * (i - 0.5 * (folds - 1));
    curtain.frustum({x, i % 2 ? -0.09 : -0.06, 0}, 0.05, 1.75, material, 0.8);
  }
}

inline void put_door(Scene& scene, const Palette& palette, const Vector3d& place, double yaw) {
  Placer door(scene, kDoor, place, yaw);
  door.box({0, -0.02, 1.0}, {0.86, 0.04, 2.0}, palette.dark_wood);
  for (const double z : {0.5, 1.45}) door.box({0, -0.045, z}, {0.56, 0.02, 0.7}, palette.light_wood);
  for (const double x : {-0.47, 0.47}) door.box({x, -0.03, 1.03}, {0.08, 0.06, 2.06}, palette.white);
  door.box({0, -0.03, 2.06}, {1.02, 0.06, 0.08}, palette.white)
      .ellipsoid({0.36, -0.09, 1.0}, {0.035, 0.04, 0.035}, palette.metal);
}

inline void put_picture(Scene& scene, const Palette& palette, const Vector3d& centre, double yaw, const Material& art,
                        const Eigen::Vector2d& size) {
  Placer(scene, kPicture, centre, yaw)
      .box({0, -0.015, 0}, {size.x() + 0.08, 0.03, size.y() + 0.08}, palette.black)
      .box({0, -0.033, 0}, {size.x(), 0.01, size.y()}, scene.add_material(art));
}

}  // namespace langgs::detail
