// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/confirm_join.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// All cells between the same two parts.
class PartPair {
 public:
  PartPair(const JoinFilterOptions& options, const DriveParts& parts,
           const std::vector<JoinCell>& cells)
      : options_(options), parts_(parts), cells_(cells) {
    const auto& [edge, i, j] = cells.front().best;
    is_metric_ =
        parts.is_metric[parts.part_of[i]] && parts.is_metric[parts.part_of[j]];
  }

  // The cells that agree with each other at two places or more; by cell.
  std::vector<bool> FindConfirmed() const {
    struct Hypothesis {
      int num_pairs = 0;
      size_t cell = 0;
      double scale = 1.0;
    };
    std::vector<Hypothesis> hypotheses;
    for (size_t c = 0; c < cells_.size(); ++c) {
      const double scale = FindScale(c);
      hypotheses.push_back({CountPairs(FindAgreeing(c, scale)), c, scale});
    }
    std::stable_sort(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& a, const Hypothesis& b) {
                       return a.num_pairs > b.num_pairs;
                     });
    for (const auto& [num_pairs, cell, scale] : hypotheses) {
      std::vector<bool> agree = FindAgreeing(cell, scale);
      if (!HasSecondPlace(cell, agree)) continue;
      agree = DropMinorities(agree, scale);
      if (agree[cell] && HasSecondPlace(cell, agree)) return agree;
    }
    return std::vector<bool>(cells_.size(), false);
  }

 private:
  int CountPairs(const std::vector<bool>& selected) const {
    int num_pairs = 0;
    for (size_t c = 0; c < cells_.size(); ++c) {
      if (selected[c]) num_pairs += cells_[c].crossings.size();
    }
    return num_pairs;
  }

  // In the order of capture.
  int64_t Distance(int a, int b) const {
    return std::abs(parts_.rank_of[a] - parts_.rank_of[b]);
  }

  bool IsNear(const JoinCell& a, const JoinCell& b) const {
    return Distance(a.best.i, b.best.i) <= options_.max_sequence_gap &&
           Distance(a.best.j, b.best.j) <= options_.max_sequence_gap;
  }

  bool IsPlace(size_t c, const std::vector<bool>& agree) const {
    int num_pairs = 0;
    for (size_t d = 0; d < cells_.size(); ++d) {
      if (agree[d] && IsNear(cells_[c], cells_[d])) {
        num_pairs += cells_[d].crossings.size();
      }
    }
    return num_pairs >= options_.min_num_pairs;
  }

  bool IsBeyond(int a, int b) const {
    const int64_t distance = Distance(a, b);
    return distance > options_.max_place_images ||
           (distance > options_.max_sequence_gap &&
            parts_.street_of[a] != parts_.street_of[b]);
  }

  bool HasSecondPlace(size_t c, const std::vector<bool>& agree) const {
    if (!IsPlace(c, agree)) return false;
    for (size_t d = 0; d < cells_.size(); ++d) {
      if (agree[d] && IsBeyond(cells_[c].best.i, cells_[d].best.i) &&
          IsBeyond(cells_[c].best.j, cells_[d].best.j) && IsPlace(d, agree)) {
        return true;
      }
    }
    return false;
  }

  std::vector<bool> FindAgreeing(size_t c, double scale) const {
    std::vector<bool> agree(cells_.size(), false);
    for (size_t d = 0; d < cells_.size(); ++d) {
      agree[d] = d == c || Agree(cells_[c], cells_[d], scale);
    }
    return agree;
  }

  // Those that agree with more than half of the others.
  std::vector<bool> DropMinorities(const std::vector<bool>& selected,
                                   double scale) const {
    std::vector<bool> kept = selected;
    const int num_selected = std::count(selected.begin(), selected.end(), true);
    for (size_t c = 0; c < cells_.size(); ++c) {
      if (!selected[c]) continue;
      int num_agreeing = 0;
      for (size_t d = 0; d < cells_.size(); ++d) {
        num_agreeing +=
            selected[d] && (d == c || Agree(cells_[c], cells_[d], scale));
      }
      kept[c] = 2 * num_agreeing > num_selected;
    }
    return kept;
  }

  bool HasMotion(const JoinCell& a, const JoinCell& b) const {
    return a.has_motion && b.has_motion &&
           parts_.frame_of[a.best.i] == parts_.frame_of[b.best.i] &&
           parts_.frame_of[a.best.j] == parts_.frame_of[b.best.j];
  }

  // From the first cell's second image to that of the other.
  Rigid3d MotionThroughFirst(const JoinCell& a, const JoinCell& b) const {
    return b.j_from_i *
           ComputeCam2FromCam1(parts_.cams_from_part[a.best.i],
                               parts_.cams_from_part[b.best.i]) *
           a.j_from_i.Inverse();
  }
  Rigid3d MotionThroughSecond(const JoinCell& a, const JoinCell& b) const {
    return ComputeCam2FromCam1(parts_.cams_from_part[a.best.j],
                               parts_.cams_from_part[b.best.j]);
  }

  // Whether the way between the places is the same in both parts.
  bool Agree(const JoinCell& a, const JoinCell& b, double scale) const {
    if (!HasMotion(a, b)) return false;
    const Rigid3d first = MotionThroughFirst(a, b);
    const Rigid3d second = MotionThroughSecond(a, b);
    if (first.rotation.angularDistance(second.rotation) >
        DegToRad(options_.max_rotation_error_deg)) {
      return false;
    }
    const double way =
        std::max(std::abs(parts_.way[a.best.i] - parts_.way[b.best.i]),
                 scale * std::abs(parts_.way[a.best.j] - parts_.way[b.best.j]));
    return (first.translation - scale * second.translation).norm() <=
           options_.max_position_error_ratio * way +
               kLengthErrorRatio * SumOfLengths(a, b);
  }

  static double SumOfLengths(const JoinCell& a, const JoinCell& b) {
    return a.j_from_i.translation.norm() + b.j_from_i.translation.norm();
  }

  // Of the second part's unit in the first one's, by the cell's distances to
  // all others: their median.
  double FindScale(size_t c) const {
    constexpr double kMaxScale = 2.0;
    std::vector<double> scales;
    for (size_t d = 0; d < cells_.size(); ++d) {
      if (is_metric_ || !HasMotion(cells_[c], cells_[d])) continue;
      const Rigid3d first = MotionThroughFirst(cells_[c], cells_[d]);
      const Rigid3d second = MotionThroughSecond(cells_[c], cells_[d]);
      const double scale = first.translation.dot(second.translation) /
                           second.translation.squaredNorm();
      // Near cells say nothing of it.
      if (first.translation.norm() > SumOfLengths(cells_[c], cells_[d]) &&
          scale < kMaxScale && scale > 1.0 / kMaxScale &&
          Agree(cells_[c], cells_[d], scale)) {
        scales.push_back(scale);
      }
    }
    return scales.empty() ? 1.0 : UpperMedian(&scales);
  }

  // Of a pair's own length.
  static constexpr double kLengthErrorRatio = 0.3;
  const JoinFilterOptions& options_;
  const DriveParts& parts_;
  const std::vector<JoinCell>& cells_;
  bool is_metric_ = false;
};

}  // namespace

std::vector<bool> ConfirmJoin(const JoinFilterOptions& options,
                              const DriveParts& parts,
                              const std::vector<JoinCell>& cells) {
  return PartPair(options, parts, cells).FindConfirmed();
}

}  // namespace adasfm
