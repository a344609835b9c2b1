// SPDX-License-Identifier: BSD-3-Clause
// Something of the pure layers and something of the plugin. COLMAP's headers
// come first, as they must: they specialise std::vector for Eigen's types.
#include "colmap_ext/evaluation/evaluation.h"
// The rest.
#include <colmap_ext/report/report_html.h>
#include <core/so3.h>
#include <synthetic/synthetic_world.h>

#include <iostream>

int main() {
  const Eigen::Vector3d turn(0.1, 0.2, 0.3);
  const double error = (adasfm::LogSo3(adasfm::ExpSo3(turn)) - turn).norm();
  const double rmse_px =
      adasfm::ComputeReprojectionRmse(colmap::Reconstruction());
  std::cout << adasfm::EscapeHtml("<ok>") << std::endl;
  return error < 1e-12 && rmse_px == 0.0 ? 0 : 1;
}
