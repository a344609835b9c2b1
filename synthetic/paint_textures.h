// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/random.h"

namespace adasfm {

// A row of houses seen from the street.
struct FacadePicture {
  cv::Mat picture;  // CV_8UC3, first row at the ground
  // By column: where the house ends and the sky begins.
  std::vector<double> height_m;
};

// Houses with bricks or plaster, windows, doors, signs and stains, all at
// random: rich in features that differ from each other.
FacadePicture PaintFacade(double width_m, double height_m, double px_per_m,
                          Random* random);

// Asphalt with patches, cracks and marks.
cv::Mat PaintRoad(double length_m, double width_m, double px_per_m,
                  Random* random);

}  // namespace adasfm
