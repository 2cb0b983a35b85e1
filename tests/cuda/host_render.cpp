// SPDX-License-Identifier: Apache-2.0
#include "cuda/host_render.hpp"

#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

namespace langgs::test {
namespace {

template <class T>
std::vector<T> copy(const T* values, std::ptrdiff_t count) {
  return std::vector<T>(values, values + count);
}

std::vector<float> dense(const PlanesView& planes) {
  std::vector<float> result;
  for (int p = 0; p < kNumPlanes; ++p) result.insert(result.end(), planes.plane(p), planes.plane(p) + planes.size);
  return result;
}

}  // namespace

HostRender render_on_host(int width, int height, int num_gaussians, std::uint64_t seed) {
  const RenderScene scene = random_scene(width, height, num_gaussians, {}, seed);
  const GaussianMap<1> map = scene.map();
  HostRender host(scene.view());
  const Executor<Host> executor;
  const int n = width * height;
  host.map = dense(map.geometry());
  host.size = map.size();

  TopKRasterizer<kTestK> rasterizer;
  rasterizer.render(executor, map.geometry(), host.view);
  const SplatList<Host>& splats = rasterizer.splats();
  const InstanceView instances = splats.instances();
  const int num_splats = splats.num_splats(), num_instances = splats.num_instances();
  host.grid = splats.grid();
  host.tile_begin = copy(instances.tile_begin, host.grid.count() + 1);
  host.sorted_slot = copy(instances.sorted_slot, num_instances);
  host.slot = copy(instances.slot, num_instances);
  host.splat_gaussian = copy(instances.splat_gaussian, num_splats);
  host.splats = copy(instances.splats, num_splats);
  host.slot_begin = copy(splats.slot_begin(), num_splats + 1);

  host.planes = copy(rasterizer.rendered().colour, 5 * n);
  host.topk_id = copy(rasterizer.topk_id(), kTestK * n);
  host.topk_weight = copy(rasterizer.topk_weight(), kTestK * n);
  host.topk_count = copy(rasterizer.statistics().topk_count, num_splats);
  host.max_weight = copy(rasterizer.statistics().max_weight, num_splats);
  host.num_hits.resize(n);
  launch(executor, host.grid.count(),
         detail::RecordHits{host.grid, instances, nullptr, host.num_hits.data(), nullptr, nullptr});

  Buffer<float, Host> target(4 * n), upstream(4 * n);
  for (int i = 0; i < 4 * n; ++i) target.data()[i] = static_cast<float>(0.2 + CounterRng{seed, 99}.uniform(i));
  for (int i = 3 * n; i < 4 * n; i += 7) target.data()[i] = 0.f;
  GeometricLoss<Host> loss;
  loss.evaluate(executor, {rasterizer.rendered().colour, rasterizer.rendered().depth, width, height},
                {target.data(), target.data() + 3 * n, width, height}, {upstream.data(), upstream.data() + 3 * n});
  host.target = copy(target.data(), 4 * n);
  host.upstream = copy(upstream.data(), 4 * n);
  MapGradient<Host> gradient;
  rasterizer.backward(executor, map.geometry(), {upstream.data(), upstream.data() + 3 * n}, gradient);
  host.gradient = dense(gradient.planes());
  host.pose = copy(gradient.pose().data(), 6);
  return host;
}

}  // namespace langgs::test
