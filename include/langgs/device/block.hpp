// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/block.hpp"
#else
#include "langgs/host/block.hpp"
#endif

/// @file How a kernel is written so that one source runs on CUDA and on the host.
///
/// A kernel is a trivially copyable struct with `kThreads`, a nested `template <class Block> struct Shared`, and
/// `template <class Block> void operator()(Block& block, Shared<Block>& shared) const`. Its code is uniform at block
/// and warp scope. What differs from thread to thread is `Varying<T>` (32 lanes on the host, one plain T on CUDA).
///
/// | call                               | CUDA                       | host                                   |
/// |------------------------------------|----------------------------|----------------------------------------|
/// | `block.threads(f)`                 | `f` once, own thread       | loop over the block's threads          |
/// | `block.warps(f)`                   | `f` once, own warp         | loop over the block's warps            |
/// | `block.sync()`                     | `__syncthreads()`          | nothing (checked: next epoch)          |
/// | `warp.any/all(mask)`               | vote                       | the same value                         |
/// | `warp.sum/max(v)`                  | xor-shuffle tree           | the same tree                          |
/// | `block.for_each_item(n, range, f)` | own warp's items, ballot   | loop over the items                    |
/// | `item.warps(f)`                    | `f` once, own warp         | loop over the item's warps             |
/// | `ItemTotals<N, n>`                 | shared memory, a row a warp| one reduction over all warps           |
/// | `KLargest<K, n>`                   | registers, inserted at once| offers set aside, inserted by `settle` |
/// | `PerThread<T>`, `PerWarp<T>`       | one register               | an aligned row                         |
/// | `SharedArray<T, N>`                | shared memory              | per-worker scratch                     |
///
/// Rules: (1) no `sync` and no phase inside a phase; (2) variables at block and warp scope are uniform, never assign
/// them from inside `threads`; (3) what crosses a phase is `PerThread` or in `Shared`; (4) write a shared element with
/// `set(i, value)`, read it with `[i]`, and put a `sync` between a write and another thread's read or write: a
/// CheckedHost launch reports a missing one, and runs threads, warps and blocks in any order asked for.

namespace langgs {

#if defined(__CUDACC__)
using gpu::WarpRange;
#else
using host::WarpRange;
template <class T>
using Varying = host::Varying<T>;
#endif

/// The lane-wise type of a block or of a lanes object: 32 values on the host, one on CUDA.
template <class T, class Scope>
using VaryingOf = typename Scope::template Varying<T>;

}  // namespace langgs
