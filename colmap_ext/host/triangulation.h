// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/correspondence_graph.h>
#include <base/reconstruction.h>
#include <sfm/incremental_triangulator.h>

#include "core/types.h"

namespace adasfm {

// COLMAP's triangulator on one reconstruction. Both arguments must outlive it.
class Triangulator {
 public:
  Triangulator(const colmap::CorrespondenceGraph* graph,
               colmap::Reconstruction* reconstruction, double min_angle_deg)
      : triangulator_(graph, reconstruction) {
    options_.min_angle = min_angle_deg;
    // A straight drive has many tracks of two views; the adjustment weighs
    // them, and verified matches made them.
    options_.ignore_two_view_tracks = false;
  }

  // Continues and creates the tracks of a registered image.
  size_t TriangulateImage(image_t image_id) {
    return triangulator_.TriangulateImage(options_, image_id);
  }

  // Joins tracks that correspondences connect and that agree within
  // max_reproj_error_px, then adds the observations that they miss.
  void CompleteAndMergeTracks(double max_reproj_error_px) {
    options_.complete_max_reproj_error = max_reproj_error_px;
    options_.merge_max_reproj_error = max_reproj_error_px;
    triangulator_.CompleteAllTracks(options_);
    triangulator_.MergeAllTracks(options_);
  }

 private:
  colmap::IncrementalTriangulator::Options options_;
  colmap::IncrementalTriangulator triangulator_;
};

}  // namespace adasfm
