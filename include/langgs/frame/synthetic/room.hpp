// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/frame/synthetic/furniture.hpp"
#include "langgs/frame/synthetic/scene.hpp"

/// @file The furnished room: where everything stands and what it is made of.

namespace langgs::detail {

[[nodiscard]] inline Material make_material(Rgb first, Rgb second, Pattern pattern, double period, float grain,
                                            double grain_length) {
  return {first, second, pattern, period, grain, grain_length, false};
}

/// One colour with a grain.
[[nodiscard]] inline Material plain(Rgb colour, float grain, double grain_length) {
  return make_material(colour, colour, Pattern::kPlain, 1, grain, grain_length);
}

[[nodiscard]] inline Palette make_palette(Scene& scene) {
  Palette p{};
  p.light_wood = scene.add_material(
      make_material({0.76f, 0.58f, 0.38f}, {0.66f, 0.48f, 0.3f}, Pattern::kStripes, 0.11, 0.22f, 0.22));
  p.dark_wood = scene.add_material(plain({0.46f, 0.31f, 0.2f}, 0.3f, 0.16));
  p.white = scene.add_material(plain({0.88f, 0.87f, 0.83f}, 0.08f, 0.25));
  p.metal = scene.add_material(plain({0.68f, 0.69f, 0.7f}, 0.12f, 0.1));
  p.black = scene.add_material(plain({0.17f, 0.17f, 0.19f}, 0.25f, 0.12));
  p.fabric = scene.add_material(
      make_material({0.3f, 0.46f, 0.56f}, {0.36f, 0.53f, 0.62f}, Pattern::kStripes, 0.12, 0.22f, 0.18));
  p.fabric_dark = scene.add_material(plain({0.72f, 0.3f, 0.22f}, 0.25f, 0.12));
  p.leaf = scene.add_material(plain({0.25f, 0.5f, 0.22f}, 0.3f, 0.1));
  p.leaf_light = scene.add_material(plain({0.42f, 0.63f, 0.28f}, 0.3f, 0.1));
  p.clay = scene.add_material(
      make_material({0.74f, 0.42f, 0.28f}, {0.62f, 0.34f, 0.22f}, Pattern::kStripes, 0.16, 0.2f, 0.12));
  p.carton = scene.add_material(plain({0.73f, 0.57f, 0.38f}, 0.22f, 0.2));
  p.paper = scene.add_material(plain({0.9f, 0.88f, 0.8f}, 0.1f, 0.1));
  Material shade = plain({0.98f, 0.86f, 0.6f}, 0.07f, 0.2);
  shade.glows = true;
  p.shade = scene.add_material(shade);
  return p;
}

inline void furnish_shell(Scene& scene) {
  const auto wallpaper = [&](Rgb a, Rgb b, Pattern pattern, double period) {
    return scene.add_material(make_material(a, b, pattern, period, 0.17f, 0.42));
  };
  scene.shell_materials[0] = wallpaper({0.82f, 0.74f, 0.64f}, {0.76f, 0.66f, 0.55f}, Pattern::kStripes, 0.5);
  scene.shell_materials[1] = wallpaper({0.87f, 0.8f, 0.66f}, {0.83f, 0.74f, 0.58f}, Pattern::kStripes, 0.36);
  scene.shell_materials[2] = wallpaper({0.7f, 0.74f, 0.78f}, {0.62f, 0.68f, 0.74f}, Pattern::kChecks, 0.6);
  scene.shell_materials[3] = wallpaper({0.7f, 0.79f, 0.7f}, {0.63f, 0.73f, 0.64f}, Pattern::kStripes, 0.3);
  scene.shell_materials[4] = scene.add_material(
      make_material({0.68f, 0.49f, 0.33f}, {0.22f, 0.14f, 0.09f}, Pattern::kPlanks, 0.16, 0.22f, 0.24));
  scene.shell_materials[5] = wallpaper({0.92f, 0.91f, 0.88f}, {0.86f, 0.85f, 0.83f}, Pattern::kChecks, 1.2);
}

/// Skirting boards along the foot of the walls, in short pieces: a long one would be in the way of every ray.
inline void put_skirting(Scene& scene, const Palette& palette) {
  constexpr int kPieces = 8;
  const Vector3d s = scene.size;
  Placer skirting(scene, kWall, Vector3d::Zero());
  for (int i = 0; i < kPieces; ++i) {
    const double x = s.x() * (i + 0.5) / kPieces, y = s.y() * (i + 0.5) / kPieces;
    for (const double side : {0.01, s.y() - 0.01}) {
      skirting.box({x, side, 0.05}, {s.x() / kPieces, 0.02, 0.1}, palette.white).shadowless();
    }
    for (const double side : {0.01, s.x() - 0.01}) {
      skirting.box({side, y, 0.05}, {0.02, s.y() / kPieces, 0.1}, palette.white).shadowless();
    }
  }
}

/// North side (y = 4.2): bookcase, sofa with cushions under a picture, floor lamp, plant in the corner.
inline void furnish_north(Scene& scene, const Palette& palette) {
  put_shelf(scene, palette, {0.85, 4.04, 0}, 0, 5);
  for (int row = 0; row < 5; ++row) {
    put_books(scene, {0.29, 4.02, 0.38 * row + 0.03}, 0, row == 1 ? 0.55 : row == 3 ? 0.7 : 0.95, row);
  }
  Placer(scene, kCarton, {0.85, 4.04, 0}).box({0.35, -0.02, 0.51}, {0.34, 0.22, 0.2}, palette.carton, 6);
  Placer(scene, kVase, {1.2, 4.0, 1.17})
      .frustum({0, 0, 0}, 0.04, 0.08, palette.clay, 1.9)
      .frustum({0, 0, 0.08}, 0.076, 0.14, palette.clay, 0.4);
  put_plant(scene, palette, {0.85, 4.04, 1.93}, 9, 0.5);
  put_sofa(scene, palette, {2.75, 3.74, 0}, 0, 1.9);
  const int rust = scene.add_material(
      make_material({0.85f, 0.55f, 0.2f}, {0.93f, 0.8f, 0.55f}, Pattern::kStripes, 0.14, 0.15f, 0.1));
  const int cream =
      scene.add_material(make_material({0.9f, 0.86f, 0.76f}, {0.7f, 0.3f, 0.3f}, Pattern::kRings, 0.16, 0.12f, 0.1));
  put_cushion(scene, rust, {2.15, 3.86, 0.46}, 14);
  put_cushion(scene, cream, {3.33, 3.86, 0.46}, -12);
  put_picture(scene, palette, {2.75, 4.2, 1.62}, 0,
              make_material({0.85f, 0.42f, 0.25f}, {0.18f, 0.35f, 0.5f}, Pattern::kRings, 0.34, 0.5f, 0.5),
              {1.05, 0.62});
  put_floor_lamp(scene, palette, {1.65, 3.9, 0});
  put_plant(scene, palette, {4.42, 3.62, 0}, 17, 1.25);
}

/// East side (x = 5): window with curtains, cabinet with a monitor, clock.
inline void furnish_east(Scene& scene, const Palette& palette) {
  put_window(scene, palette, {5.0, 2.35, 0.95}, -90);
  const int cloth = scene.add_material(
      make_material({0.72f, 0.36f, 0.33f}, {0.82f, 0.5f, 0.44f}, Pattern::kStripes, 0.09, 0.15f, 0.25));
  put_curtain(scene, cloth, {5.0, 3.18, 0.62}, -90, 5);
  put_curtain(scene, cloth, {5.0, 1.52, 0.62}, -90, 5);
  Placer(scene, kCurtain, {5.0, 2.35, 2.37}, -90).box({0, -0.08, 0}, {2.2, 0.025, 0.025}, palette.dark_wood);
  put_cabinet(scene, palette, {4.76, 0.75, 0}, -90);
  const int screen =
      scene.add_material(make_material({0.12f, 0.2f, 0.34f}, {0.2f, 0.42f, 0.55f}, Pattern::kChecks, 0.16, 0.2f, 0.2));
  Placer(scene, kMonitor, {4.78, 0.72, 0.765}, -78)
      .box({0, 0, 0.01}, {0.24, 0.16, 0.02}, palette.black)
      .frustum({0, 0.03, 0.02}, 0.02, 0.14, palette.black)
      .box({0, 0, 0.31}, {0.62, 0.035, 0.37}, palette.black)
      .box({0, -0.02, 0.31}, {0.57, 0.01, 0.32}, screen);
  Placer(scene, kVase, {4.72, 1.22, 0.765})
      .frustum({0, 0, 0}, 0.05, 0.12, palette.white, 1.6)
      .frustum({0, 0, 0.12}, 0.08, 0.1, palette.white, 0.45);
  put_books(scene, {4.66, 0.36, 0.765}, -90, 0.16, 21);
  const int dial =
      scene.add_material(make_material({0.93f, 0.92f, 0.86f}, {0.25f, 0.25f, 0.3f}, Pattern::kRings, 0.11, 0.06f, 0.1));
  const Eigen::Matrix3d to_wall = Eigen::AngleAxisd(-1.5707963267948966, Vector3d::UnitY()).toRotationMatrix();
  Placer(scene, kClock, {4.98, 0.75, 1.78})
      .solid(Solid::kFrustum, {0, 0, 0}, {0.18, 0.18, 0.02}, palette.black, to_wall)
      .solid(Solid::kFrustum, {-0.022, 0, 0}, {0.155, 0.155, 0.005}, dial, to_wall);
}

/// South (y = 0) and west (x = 0) sides: door, armchair, low shelf, cartons, pictures.
inline void furnish_south_and_west(Scene& scene, const Palette& palette) {
  put_door(scene, palette, {0.62, 0, 0}, 180);
  put_picture(scene, palette, {2.0, 0, 1.5}, 180,
              make_material({0.3f, 0.45f, 0.4f}, {0.85f, 0.75f, 0.5f}, Pattern::kChecks, 0.24, 0.4f, 0.3), {0.6, 0.8});
  put_picture(scene, palette, {3.6, 0, 1.6}, 180,
              make_material({0.75f, 0.7f, 0.6f}, {0.5f, 0.2f, 0.25f}, Pattern::kRings, 0.3, 0.4f, 0.3), {0.8, 0.55});
  put_shelf(scene, palette, {2.9, 0.17, 0}, 180, 2);
  for (int row = 0; row < 2; ++row) put_books(scene, {3.44, 0.19, 0.38 * row + 0.03}, 180, row ? 0.6 : 0.85, 30 + row);
  put_plant(scene, palette, {3.3, 0.17, 0.79}, 11, 0.55);
  Placer(scene, kCarton, {1.65, 0.3, 0}, 10)
      .box({0, 0, 0.2}, {0.5, 0.4, 0.4}, palette.carton)
      .box({0.03, 0, 0.53}, {0.36, 0.3, 0.26}, palette.carton, 25);
  put_sofa(scene, palette, {0.5, 2.75, 0}, 90, 0.95);
  put_cushion(scene, palette.fabric_dark, {0.36, 2.75, 0.46}, 84);
  put_picture(scene, palette, {0, 2.7, 1.6}, 90,
              make_material({0.2f, 0.3f, 0.5f}, {0.9f, 0.6f, 0.3f}, Pattern::kStripes, 0.3, 0.4f, 0.3), {0.9, 0.6});
  put_cabinet(scene, palette, {0.24, 1.3, 0}, 90);
  Placer(scene, kVase, {0.25, 1.6, 0.765}).frustum({0, 0, 0}, 0.05, 0.2, palette.clay, 1.3);
  put_floor_lamp(scene, palette, {0.3, 3.5, 0});
}

/// Table with chairs and what lies on it, rug, toys and cartons on the floor, the lamp under the ceiling.
inline void furnish_middle(Scene& scene, const Palette& palette) {
  const int weave = scene.add_material(
      make_material({0.63f, 0.27f, 0.25f}, {0.86f, 0.72f, 0.52f}, Pattern::kChecks, 0.36, 0.25f, 0.16));
  const int border = scene.add_material(plain({0.3f, 0.24f, 0.36f}, 0.3f, 0.15));
  Placer(scene, kRug, {2.75, 2.55, 0}, 4)
      .box({0, 0, 0.006}, {1.7, 1.2, 0.012}, border)
      .box({0, 0, 0.011}, {1.46, 0.96, 0.012}, weave);
  put_table(scene, palette, {3.35, 1.85, 0}, -12);
  put_chair(scene, palette, {3.0, 2.42, 0}, 15);
  put_chair(scene, palette, {4.18, 1.72, 0}, -80);
  put_chair(scene, palette, {3.42, 1.08, 0}, 205);
  const int yellow = scene.add_material(plain({0.93f, 0.77f, 0.28f}, 0.08f, 0.05));
  const int blue = scene.add_material(
      make_material({0.2f, 0.36f, 0.72f}, {0.8f, 0.83f, 0.88f}, Pattern::kStripes, 0.1, 0.12f, 0.08));
  const int red = scene.add_material(
      make_material({0.8f, 0.16f, 0.14f}, {0.93f, 0.88f, 0.8f}, Pattern::kStripes, 0.16, 0.12f, 0.1));
  Placer on_table(scene, kMug, {3.35, 1.85, 0.75}, -12);
  on_table.frustum({-0.42, -0.16, 0}, 0.042, 0.1, yellow).frustum({0.3, -0.22, 0}, 0.04, 0.095, palette.fabric_dark);
  on_table.as(kBook)
      .box({-0.1, -0.14, 0.02}, {0.3, 0.22, 0.04}, palette.fabric_dark, 12)
      .box({-0.09, -0.14, 0.055}, {0.26, 0.19, 0.03}, palette.fabric, -8)
      .box({-0.1, -0.13, 0.083}, {0.22, 0.16, 0.025}, yellow, 20);
  on_table.as(kVase).frustum({0.12, 0.16, 0}, 0.05, 0.1, blue, 1.7).frustum({0.12, 0.16, 0.1}, 0.085, 0.13, blue, 0.45);
  on_table.as(kPlant);
  for (int i = 0; i < 7; ++i) {
    const double turn = 2.399963 * i;
    on_table.ellipsoid({0.12 + 0.07 * std::cos(turn), 0.16 + 0.07 * std::sin(turn), 0.3 + 0.012 * i},
                       {0.035, 0.035, 0.05}, i % 2 ? palette.leaf_light : yellow);
  }
  on_table.as(kBlueBall).ellipsoid({0.47, 0.12, 0.06}, {0.06, 0.06, 0.06}, blue);
  on_table.as(kCarton).box({-0.4, 0.18, 0.07}, {0.22, 0.16, 0.14}, palette.carton, 30);
  Placer(scene, kRedBall, {2.2, 2.25, 0})
      .ellipsoid({0, 0, 0.15}, {0.15, 0.15, 0.15}, red, Eigen::AngleAxisd(0.7, Vector3d::UnitX()).toRotationMatrix());
  Placer(scene, kBlueBall, {1.95, 3.05, 0})
      .ellipsoid({0, 0, 0.11}, {0.11, 0.11, 0.11}, blue, Eigen::AngleAxisd(-0.9, Vector3d::UnitY()).toRotationMatrix());
  Placer(scene, kRedBall, {3.7, 0.5, 0}).ellipsoid({0, 0, 0.09}, {0.09, 0.09, 0.09}, red);
  Placer(scene, kCarton, {4.45, 2.75, 0}, 35)
      .box({0, 0, 0.14}, {0.4, 0.3, 0.28}, palette.carton)
      .box({-0.02, 0.02, 0.36}, {0.24, 0.2, 0.16}, palette.paper, 30);
  Material glow = plain({1.f, 0.95f, 0.82f}, 0.03f, 0.2);
  glow.glows = true;
  Placer(scene, kLamp, {2.3, 1.9, 2.2})
      .frustum({0, 0, 0}, 0.24, 0.16, scene.add_material(glow), 0.7)
      .shadowless()
      .frustum({0, 0, 0.16}, 0.01, 0.24, palette.black)
      .shadowless();
}

[[nodiscard]] inline Scene furnished_room(std::uint64_t seed) {
  Scene scene;
  scene.seed = mix64(seed ^ 0x726F6F6Dull);
  const Palette palette = make_palette(scene);
  furnish_shell(scene);
  put_skirting(scene, palette);
  furnish_north(scene, palette);
  furnish_east(scene, palette);
  furnish_south_and_west(scene, palette);
  furnish_middle(scene, palette);
  return scene;
}

}  // namespace langgs::detail
