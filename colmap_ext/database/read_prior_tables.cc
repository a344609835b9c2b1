// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <locale>
#include <map>
#include <optional>
#include <sstream>
#include <tuple>
#include <utility>

#include "colmap_ext/database/image_names.h"
#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/double_blob.h"
#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// Flags of imported priors; lengths of adasfm_global are not stored here.
constexpr uint32_t kAllFlags =
    kPriorRotation | kPriorDirection | kPriorLength | kPriorWheelSlip;

void ReadImageTimes(const ImageNames& names, SqliteConnection* database,
                    LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_image_times")) return;
  SqliteStatement statement(database,
                            "SELECT name, timestamp_ns FROM adasfm_image_times "
                            "ORDER BY timestamp_ns, name");
  while (statement.Step()) {
    const std::optional<image_t> image_id = names.Id(statement.Text(0));
    if (image_id.has_value()) {
      loaded->tables.image_times.push_back({*image_id, statement.Int(1)});
    } else {
      ++loaded->num_ignored_rows;
    }
  }
}

RelativePosePrior PriorFromRow(const SqliteStatement& statement) {
  const std::string row = "table adasfm_relative_pose_priors, images " +
                          statement.Text(0) + " and " + statement.Text(1);
  RelativePosePrior prior;
  Eigen::Vector4d qvec;
  Eigen::Vector3d tvec;
  prior.dt_ns = statement.Int(2);
  DoublesFromBlob(statement, 3, row, 4, qvec.data());
  DoublesFromBlob(statement, 4, row, 3, tvec.data());
  DoublesFromBlob(statement, 5, row, 36, prior.covariance.data());
  const int64_t flags = statement.Int(6);
  // Variances may be infinite, and unobserved values may be anything finite.
  if (!tvec.allFinite() || !(std::abs(qvec.norm() - 1.0) < 1e-6) ||
      prior.covariance.hasNaN() ||
      !(prior.covariance.diagonal().array() >= 0.0).all() || prior.dt_ns < 0 ||
      (flags & ~static_cast<int64_t>(kAllFlags)) != 0) {
    throw SqliteError(row + ": values that are not a pose prior");
  }
  prior.cam2_from_cam1 =
      Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
  prior.flags = static_cast<uint32_t>(flags);
  return prior;
}

// Sorts by chains of consecutive images: chains by their first time, and the
// priors of a chain by time. Several drives may overlap in time.
void SortByChain(const std::map<image_t, timestamp_t>& times,
                 std::vector<RelativePosePrior>* priors) {
  std::map<image_t, int> index_of;
  for (const auto& [image_id, time] : times) {
    index_of.emplace(image_id, static_cast<int>(index_of.size()));
  }
  DisjointSets chains(index_of.size());
  for (const RelativePosePrior& prior : *priors) {
    chains.Join(index_of.at(prior.image_id1), index_of.at(prior.image_id2));
  }
  std::map<int, std::pair<timestamp_t, image_t>> first_of;
  for (const auto& [image_id, time] : times) {
    const auto start = std::make_pair(time, image_id);
    const auto [first, is_new] =
        first_of.emplace(chains.Find(index_of.at(image_id)), start);
    if (!is_new) first->second = std::min(first->second, start);
  }
  const auto key = [&](const RelativePosePrior& prior) {
    return std::make_tuple(
        first_of.at(chains.Find(index_of.at(prior.image_id1))),
        times.at(prior.image_id1), times.at(prior.image_id2));
  };
  std::stable_sort(
      priors->begin(), priors->end(),
      [&key](const RelativePosePrior& a, const RelativePosePrior& b) {
        return key(a) < key(b);
      });
}

// The images that a row names in its first columns; counts the row when the
// database lacks one.
std::optional<std::pair<image_t, image_t>> ResolvePair(
    const ImageNames& names, const SqliteStatement& statement,
    LoadedPriorTables* loaded) {
  const auto pair = names.Ids(statement);
  if (!pair) ++loaded->num_ignored_rows;
  return pair;
}

void ReadPriors(const ImageNames& names, SqliteConnection* database,
                LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_relative_pose_priors")) return;
  std::map<image_t, timestamp_t> times;
  for (const ImageTimeRow& row : loaded->tables.image_times) {
    times[row.image_id] = row.timestamp_ns;
  }
  SqliteStatement statement(
      database,
      "SELECT name1, name2, dt_ns, qvec, tvec, covariance, flags "
      "FROM adasfm_relative_pose_priors ORDER BY image_id1, image_id2");
  while (statement.Step()) {
    const auto pair = ResolvePair(names, statement, loaded);
    if (!pair) continue;
    RelativePosePrior prior = PriorFromRow(statement);
    std::tie(prior.image_id1, prior.image_id2) = *pair;
    const bool has_time1 = times.count(pair->first) > 0;
    if (!has_time1 || times.count(pair->second) == 0) {
      throw SqliteError("table adasfm_relative_pose_priors: image " +
                        statement.Text(has_time1 ? 1 : 0) + " has no time");
    }
    loaded->tables.priors.push_back(prior);
  }
  SortByChain(times, &loaded->tables.priors);
}

struct TimeShiftEffect {
  Eigen::Vector3d rotation, translation, delta_velocity, delta_position;
};

TimeShiftEffect EffectFromRow(const SqliteStatement& statement) {
  const std::string row = "table adasfm_time_shift_effects, images " +
                          statement.Text(0) + " and " + statement.Text(1);
  TimeShiftEffect effect;
  int column = 2;
  for (Eigen::Vector3d* vector :
       {&effect.rotation, &effect.translation, &effect.delta_velocity,
        &effect.delta_position}) {
    DoublesFromBlob(statement, column++, row, 3, vector->data());
    if (!vector->allFinite())
      throw SqliteError(row + ": values that are no rates");
  }
  return effect;
}

// After priors and inertial motions; rows of other pairs count for nothing.
void ReadTimeShiftEffects(const ImageNames& names, SqliteConnection* database,
                          PriorTables* tables) {
  if (!database->HasTable("adasfm_time_shift_effects")) return;
  std::map<std::pair<image_t, image_t>, TimeShiftEffect> effects;
  SqliteStatement statement(
      database,
      "SELECT name1, name2, rotation, translation, delta_velocity, "
      "delta_position FROM adasfm_time_shift_effects");
  while (statement.Step()) {
    const auto pair = names.Ids(statement);
    if (pair) effects[*pair] = EffectFromRow(statement);
  }
  for (RelativePosePrior& prior : tables->priors) {
    const auto found = effects.find({prior.image_id1, prior.image_id2});
    if (found == effects.end()) continue;
    prior.rotation_by_time_shift = found->second.rotation;
    prior.translation_by_time_shift = found->second.translation;
  }
  for (InertialMotion& motion : tables->inertial_motions) {
    const auto found = effects.find({motion.image_id1, motion.image_id2});
    if (found == effects.end()) continue;
    motion.velocity_by_time_shift = found->second.delta_velocity;
    motion.position_by_time_shift = found->second.delta_position;
    motion.translation_by_time_shift = found->second.translation;
  }
}

void ReadGravity(const ImageNames& names, SqliteConnection* database,
                 LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_gravity")) return;
  SqliteStatement statement(
      database,
      "SELECT name, gravity_in_cam FROM adasfm_gravity ORDER BY name");
  while (statement.Step()) {
    const std::string name = statement.Text(0);
    const std::string row = "table adasfm_gravity, image " + name;
    const std::optional<image_t> image_id = names.Id(name);
    if (!image_id.has_value()) {
      ++loaded->num_ignored_rows;
      continue;
    }
    GravityRow gravity;
    gravity.image_id = *image_id;
    DoublesFromBlob(statement, 1, row, 3, gravity.gravity_in_cam.data());
    if (!(std::abs(gravity.gravity_in_cam.norm() - 1.0) < 1e-6)) {
      throw SqliteError(row + ": not a unit vector");
    }
    loaded->tables.gravity.push_back(gravity);
  }
}

PositionPrior PositionFromRow(const SqliteStatement& statement) {
  const std::string row = "table adasfm_position_priors, images " +
                          statement.Text(0) + " and " + statement.Text(1);
  PositionPrior prior;
  prior.share = statement.Double(2);
  DoublesFromBlob(statement, 3, row, 3, prior.position.data());
  DoublesFromBlob(statement, 4, row, 9, prior.covariance.data());
  DoublesFromBlob(statement, 5, row, 3, prior.antenna_in_cam.data());
  const Eigen::LLT<Eigen::Matrix3d> cholesky(prior.covariance);
  if (!prior.position.allFinite() || !prior.covariance.allFinite() ||
      !prior.antenna_in_cam.allFinite() || !(prior.share >= 0.0) ||
      !(prior.share <= 1.0) || cholesky.info() != Eigen::Success) {
    throw SqliteError(row + ": values that are not a position");
  }
  return prior;
}

void ReadPositions(const ImageNames& names, SqliteConnection* database,
                   LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_position_priors")) return;
  SqliteStatement statement(
      database,
      "SELECT name1, name2, share, position, covariance, antenna_in_cam "
      "FROM adasfm_position_priors ORDER BY rowid");
  while (statement.Step()) {
    const auto pair = ResolvePair(names, statement, loaded);
    if (!pair) continue;
    PositionPrior prior = PositionFromRow(statement);
    std::tie(prior.image_id1, prior.image_id2) = *pair;
    loaded->tables.positions.push_back(prior);
  }
}

// For merged imports, the covariance with the largest trace.
void ReadGyroscopeBias(SqliteConnection* database, PriorTables* tables) {
  if (!database->HasTable("adasfm_gyroscope_bias")) return;
  SqliteStatement statement(
      database, "SELECT name, covariance FROM adasfm_gyroscope_bias");
  while (statement.Step()) {
    const std::string row =
        "table adasfm_gyroscope_bias, image " + statement.Text(0);
    Eigen::Matrix3d covariance;
    DoublesFromBlob(statement, 1, row, 9, covariance.data());
    if (!covariance.allFinite() ||
        Eigen::LLT<Eigen::Matrix3d>(covariance).info() != Eigen::Success) {
      throw SqliteError(row + ": values that are not a covariance");
    }
    auto& worst = tables->gyroscope_bias_covariance;
    if (!worst || covariance.trace() > worst->trace()) worst = covariance;
  }
}

// For merged imports, the largest value.
void ReadLengthDrift(SqliteConnection* database, PriorTables* tables) {
  if (!database->HasTable("adasfm_length_drift")) return;
  SqliteStatement statement(
      database, "SELECT name, sigma_ratio FROM adasfm_length_drift");
  while (statement.Step()) {
    const double ratio = statement.Double(1);
    if (!std::isfinite(ratio) || !(ratio > 0.0)) {
      throw SqliteError("table adasfm_length_drift, image " +
                        statement.Text(0) + ": a sigma that is not positive");
    }
    tables->length_drift_ratio = std::max(tables->length_drift_ratio, ratio);
  }
}

// Several imports have different scales; the result then has none.
void ReadWheelScale(SqliteConnection* database, PriorTables* tables) {
  if (!database->HasTable("adasfm_wheel_scale")) return;
  SqliteStatement statement(
      database,
      "SELECT name, scale, sigma, stated_sigma FROM adasfm_wheel_scale");
  int num_rows = 0;
  while (statement.Step()) {
    const WheelScale scale = {statement.Double(1), statement.Double(2),
                              statement.Double(3)};
    for (const double value : {scale.scale, scale.sigma, scale.stated_sigma}) {
      if (std::isfinite(value) && value > 0.0) continue;
      throw SqliteError("table adasfm_wheel_scale, image " + statement.Text(0) +
                        ": values that are not positive");
    }
    tables->wheel_scale = scale;
    ++num_rows;
  }
  if (num_rows > 1) tables->wheel_scale.reset();
}

void ReadPositionOrigin(SqliteConnection* database, PriorTables* tables) {
  if (!database->HasTable("adasfm_meta")) return;
  SqliteStatement statement(
      database, "SELECT value FROM adasfm_meta WHERE key = 'position_origin'");
  if (!statement.Step()) return;
  GeodeticPosition origin;
  std::istringstream text(statement.Text(0));
  text.imbue(std::locale::classic());
  if (!(text >> origin.latitude_deg >> origin.longitude_deg >>
        origin.height_m)) {
    throw SqliteError("table adasfm_meta: position_origin is no position");
  }
  tables->position_origin = origin;
}

}  // namespace

StatusOr<LoadedPriorTables> ReadPriorTables(const std::string& database_path) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    return ReadPriorTables(&database);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what() +
                         "; run adasfm_prior_importer again");
  }
}

LoadedPriorTables ReadPriorTables(SqliteConnection* database) {
  CheckMetaTable(database);
  const ImageNames names(database);
  LoadedPriorTables loaded;
  ReadImageTimes(names, database, &loaded);
  ReadPriors(names, database, &loaded);
  ReadGravity(names, database, &loaded);
  ReadPositions(names, database, &loaded);
  ReadGyroscopeBias(database, &loaded.tables);
  ReadLengthDrift(database, &loaded.tables);
  ReadWheelScale(database, &loaded.tables);
  loaded.tables.inertial_motions =
      ReadInertialMotions(names, database, &loaded.num_ignored_rows);
  ReadTimeShiftEffects(names, database, &loaded.tables);
  ReadPositionOrigin(database, &loaded.tables);
  return loaded;
}

}  // namespace adasfm
