// SPDX-License-Identifier: Apache-2.0
// Every kernel, those that depend on K for K = 1, 3, 5 and 10. tests/checks/cuda_kernels.sh lists what each of them
// needs.
#include "langgs/device/launch.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/colour_loss.hpp"
#include "langgs/optimize/depth_loss.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/optimize/feature_hits.hpp"
#include "langgs/optimize/feature_weight_gradient.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_compositor.hpp"
#include "langgs/render/map_gradient.hpp"
#include "langgs/render/splat_list.hpp"
#include "langgs/render/tile_backward.hpp"
#include "langgs/render/tile_forward.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "langgs/slam/mapping_kernels.hpp"
#include "langgs/slam/teacher_cosine.hpp"
#include "langgs/slam/view_renderer.hpp"

namespace langgs {

template void launch(const Executor<Cuda>&, int, const TileForward<0>&);
template void launch(const Executor<Cuda>&, int, const TileForward<1>&);
template void launch(const Executor<Cuda>&, int, const TileForward<3>&);
template void launch(const Executor<Cuda>&, int, const TileForward<5>&);
template void launch(const Executor<Cuda>&, int, const TileForward<10>&);
template void launch(const Executor<Cuda>&, int, const TileBackward&);
template void launch(const Executor<Cuda>&, int, const TileBackwardWith<TopKWeightGradient<1>>&);
template void launch(const Executor<Cuda>&, int, const TileBackwardWith<TopKWeightGradient<3>>&);
template void launch(const Executor<Cuda>&, int, const TileBackwardWith<TopKWeightGradient<5>>&);
template void launch(const Executor<Cuda>&, int, const TileBackwardWith<TopKWeightGradient<10>>&);
template void launch(const Executor<Cuda>&, int, const detail::RecordHits&);
template void launch(const Executor<Cuda>&, int, const CompositeFeatures<512, Half, FeatureImageSink<512, Half>>&);
template void launch(const Executor<Cuda>&, int, const CompositeFeatures<512, Half, FeatureImageSink<512, float>>&);
template void launch(const Executor<Cuda>&, int, const CompositeFeatures<512, Half, detail::CosineSums<512>>&);
template void launch(const Executor<Cuda>&, int, const CompositeFeatures<512, float, detail::FeatureSigns<512>>&);
template void launch(const Executor<Cuda>&, int, const detail::AdamFeatureUpdate<512, float>&);
template void launch(const Executor<Cuda>&, int, const detail::AverageUpdate<512, Half>&);
template void launch(const Executor<Cuda>&, int, const detail::FeatureWeightSlopes<512, 3, float>&);
template void launch(const Executor<Cuda>&, int, const detail::FeatureWeightSlopes<512, 1, Half>&);
template void launch(const Executor<Cuda>&, int, const detail::FeatureWeightSlopes<512, 3, Half>&);
template void launch(const Executor<Cuda>&, int, const detail::FeatureWeightSlopes<512, 5, Half>&);
template void launch(const Executor<Cuda>&, int, const detail::FeatureWeightSlopes<512, 10, Half>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::ScatterSlopes&);

template void launch(const Executor<Cuda>&, int, const detail::ColourKernel&);
template void launch(const Executor<Cuda>&, int, const detail::DepthL1&);
template void launch(const Executor<Cuda>&, int, const detail::AdamUpdate&);

template void for_each_lanes(const Executor<Cuda>&, const ListSize&, const ProjectGaussians&);
template void for_each_lanes(const Executor<Cuda>&, const ListSize&, const CountTiles&);
template void for_each_lanes(const Executor<Cuda>&, const ListSize&, const PackSplats&);
template void for_each_lanes(const Executor<Cuda>&, const ListSize&, const EmitInstances&);
template void for_each_lanes(const Executor<Cuda>&, const ListSize&, const GatherGradient&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const EndSlots&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const PutView&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::AdmitLists<2>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::EndList<std::uint32_t>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::EndList<KeyValue>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const ReduceStatistics&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::TakeValues&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::TakeRows<Half>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::UnpackTarget&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CollectStatistics&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::ScorePrompts<512, Half>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::PickLabel&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::FindGroups<KeyValue>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::FindGroups<std::uint32_t>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::FillElements<float>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CountTopK<1>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CountTopK<3>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CountTopK<5>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CountTopK<10>&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::FillTopK&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CopyCounts&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::CopyHits&);
template void for_each_n(const Executor<Cuda>&, const ListSize&, const detail::FirstPatch&);

}  // namespace langgs
