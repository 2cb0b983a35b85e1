// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file Everything that a SLAM stack includes, in the order of the pipeline. See docs/design.md for the map of it.

#include "langgs/version.hpp"

// What arrives.
#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/frame/label_features.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/frame/texture_features.hpp"
#include "langgs/frame/undistort.hpp"

// Tracking: GicpTracker, KeyframePolicy.
#include "langgs/track/gicp_tracker.hpp"
#include "langgs/track/grid_target.hpp"
#include "langgs/track/kd_tree_target.hpp"
#include "langgs/track/keyframe_policy.hpp"

// The map: Gaussian<FeatDim>, GaussianMap<FeatDim>, Keyframe<FeatDim>.
#include "langgs/map/gaussian_map.hpp"
#include "langgs/map/keyframe.hpp"
#include "langgs/map/keyframe_store.hpp"

// Rendering: TopKRasterizer<K>, features from Top-K records.
#include "langgs/render/feature_compositor.hpp"
#include "langgs/render/topk_rasterizer.hpp"

// Optimisation and management: losses, HybridSchedule, PruningPolicy, insertion.
#include "langgs/manage/insertion.hpp"
#include "langgs/manage/pruning_policy.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/optimize/feature_step.hpp"
#include "langgs/optimize/feature_weight_gradient.hpp"
#include "langgs/optimize/field_coupling.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/optimize/hybrid_schedule.hpp"
#include "langgs/optimize/pose_refinement.hpp"

// The system.
#include "langgs/slam/slam.hpp"

// Evaluation and files.
#include "langgs/eval/agreement_f3dgs.hpp"
#include "langgs/eval/image_metrics.hpp"
#include "langgs/eval/semantics.hpp"
#include "langgs/eval/trajectory.hpp"
#include "langgs/io/npy.hpp"
#include "langgs/io/ply.hpp"
#include "langgs/io/safetensors.hpp"
#include "langgs/io/tum_trajectory.hpp"
