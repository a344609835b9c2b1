// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/predict_motions.h"

#include <memory>

#include "colmap_ext/database/prior_tables.h"
#include "global/odometry/odometry_chain.h"

namespace adasfm {

StatusOr<MotionPredictor> ReadMotionPredictor(
    const std::string& database_path) {
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path);
  if (!tables.ok()) return tables.status();
  if (tables->tables.priors.empty()) return MotionPredictor();
  OdometryChainOptions options;
  options.gyro_bias_covariance = tables->tables.gyroscope_bias_covariance;
  const auto chain =
      std::make_shared<const OdometryChain>(tables->tables.priors, options);
  return MotionPredictor(
      [chain](const ImagePair& pair) -> std::optional<PredictedMotion> {
        if (!chain->IsConnected(pair.image_id1, pair.image_id2)) {
          return std::nullopt;
        }
        const ChainMotion motion =
            chain->Motion(pair.image_id1, pair.image_id2);
        if (!motion.has_rotation || !motion.has_position) return std::nullopt;
        return PredictedMotion{motion.cam2_from_cam1, motion.covariance};
      });
}

}  // namespace adasfm
