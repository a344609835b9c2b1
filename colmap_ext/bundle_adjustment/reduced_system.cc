// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/reduced_system.h"

#include <utility>

#include "colmap_ext/bundle_adjustment/bundle_reducer.h"

namespace adasfm {

std::unique_ptr<ReducedSystem> BuildReducedSystem(BundleProblem* bundle,
                                                  const double* unit) {
  auto system = std::make_unique<ReducedSystem>();
  BundleReducer reducer(bundle, 1);
  reducer.Linearize(/*inverse_radius=*/0.0, &system->priors);
  const std::vector<double*>& parameters = reducer.Parameters();
  for (size_t block = 0; block < parameters.size(); ++block) {
    if (parameters[block] == unit) {
      system->unit_column =
          reducer.Matrix().FirstColumnOf(static_cast<int>(block));
    }
  }
  system->rest.swap(reducer.Matrix().Matrix());
  system->rest_gradient = reducer.Gradient();
  return system;
}

}  // namespace adasfm
