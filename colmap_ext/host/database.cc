// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database.h"

#include <cstring>
#include <filesystem>

#include "colmap_ext/host/database_schema.h"

namespace adasfm {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

[[noreturn]] void ThrowRowError(const std::string& table, int64_t row,
                                const std::string& what) {
  throw SqliteError("table " + table + ", row " + std::to_string(row) + ": " +
                    what);
}

std::vector<FeatureMatch> MatchesFromRow(const SqliteStatement& statement,
                                         const std::string& table,
                                         int first_column) {
  static_assert(sizeof(FeatureMatch) == 2 * sizeof(point2D_t), "blob layout");
  const int64_t num_rows = statement.Int(first_column);
  const int64_t num_bytes = statement.NumBytes(first_column + 2);
  // A row has at least one byte; this check comes first, so that the product
  // cannot overflow.
  if (num_rows < 0 || num_rows > num_bytes ||
      (num_rows > 0 && statement.Int(first_column + 1) != 2) ||
      num_bytes != num_rows * static_cast<int64_t>(sizeof(FeatureMatch))) {
    ThrowRowError(table, statement.Int(0), "malformed matches");
  }
  std::vector<FeatureMatch> matches(num_rows);
  if (num_rows > 0) {
    std::memcpy(matches.data(), statement.Blob(first_column + 2), num_bytes);
  }
  return matches;
}

std::vector<Eigen::Vector2d> KeypointsFromRow(
    const SqliteStatement& statement) {
  const int64_t num_rows = statement.Int(1);
  const int64_t num_cols = statement.Int(2);
  const int64_t num_bytes = statement.NumBytes(3);
  // The same checks; SQLite's blobs have less than 2^31 bytes.
  if (num_rows < 0 || num_rows > num_bytes ||
      (num_rows > 0 && (num_cols < 2 || num_cols > num_bytes)) ||
      (num_rows > 0 && num_bytes != num_rows * num_cols *
                                        static_cast<int64_t>(sizeof(float)))) {
    ThrowRowError("keypoints", statement.Int(0), "malformed keypoints");
  }
  std::vector<Eigen::Vector2d> points;
  points.reserve(num_rows);
  const char* data = static_cast<const char*>(statement.Blob(3));
  for (int64_t i = 0; i < num_rows; ++i) {
    Eigen::Vector2f point;
    std::memcpy(point.data(), data + i * num_cols * sizeof(float),
                2 * sizeof(float));
    points.push_back(point.cast<double>());
  }
  return points;
}

// A fixed-size blob of doubles; zeros when the row has none.
template <typename Matrix>
Matrix MatrixFromRow(const SqliteStatement& statement, const std::string& table,
                     int column) {
  Matrix matrix = Matrix::Zero();
  const size_t num_bytes = statement.NumBytes(column);
  if (num_bytes == 0) return matrix;
  if (num_bytes != matrix.size() * sizeof(double)) {
    ThrowRowError(table, statement.Int(0),
                  "a matrix of " + std::to_string(num_bytes) + " bytes");
  }
  std::memcpy(matrix.data(), statement.Blob(column), num_bytes);
  if (!matrix.allFinite()) {
    ThrowRowError(table, statement.Int(0), "a matrix that is not finite");
  }
  return matrix;
}

std::optional<Rigid3d> PoseFromBlobs(const Eigen::Vector4d& qvec,
                                     const Eigen::Vector3d& tvec) {
  if (qvec.isZero() || tvec.isZero()) return std::nullopt;
  return Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
}

}  // namespace

Status CheckDatabase(const std::string& database_path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(database_path, error)) {
    return Status::Error("the database " + database_path +
                         " does not exist or is not a file; check "
                         "--database_path");
  }
  if (std::filesystem::file_size(database_path, error) == 0) {
    return Status::Error("the database " + database_path +
                         " is empty; run COLMAP's feature_extractor and a "
                         "matcher on it first");
  }
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    return CheckColumns(database_path, &database);
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + " is not a database of COLMAP (" +
                         sqlite_error.what() + "); check --database_path");
  }
}

static std::vector<DatabaseImage> ReadImagesWhere(SqliteConnection* database,
                                                  const std::string& which) {
  std::vector<DatabaseImage> images;
  SqliteStatement statement(
      database, "SELECT image_id, name, camera_id FROM images " + which);
  while (statement.Step()) {
    images.push_back({static_cast<image_t>(statement.Int(0)),
                      static_cast<camera_t>(statement.Int(2)),
                      statement.Text(1)});
  }
  return images;
}

std::vector<DatabaseImage> ReadImages(SqliteConnection* database) {
  return ReadImagesWhere(database, "ORDER BY image_id");
}

std::vector<DatabaseImage> ReadImagesWithoutFeatures(
    SqliteConnection* database) {
  return ReadImagesWhere(
      database,
      "WHERE image_id NOT IN (SELECT image_id FROM keypoints) OR image_id NOT "
      "IN (SELECT image_id FROM descriptors) ORDER BY name");
}

std::map<image_t, std::vector<Eigen::Vector2d>> ReadKeypoints(
    SqliteConnection* database) {
  std::map<image_t, std::vector<Eigen::Vector2d>> keypoints;
  SqliteStatement statement(
      database,
      "SELECT image_id, rows, cols, data FROM keypoints ORDER BY image_id");
  while (statement.Step()) {
    keypoints[statement.Int(0)] = KeypointsFromRow(statement);
  }
  return keypoints;
}

std::vector<Eigen::Vector2d> ReadKeypointsOfImage(SqliteConnection* database,
                                                  image_t image_id) {
  SqliteStatement statement(
      database,
      "SELECT image_id, rows, cols, data FROM keypoints WHERE image_id = ?");
  statement.BindInt(1, image_id);
  return statement.Step() ? KeypointsFromRow(statement)
                          : std::vector<Eigen::Vector2d>();
}

void ReadMatches(
    SqliteConnection* database,
    const std::function<void(const ImagePair&, std::vector<FeatureMatch>)>&
        function) {
  SqliteStatement statement(
      database,
      "SELECT pair_id, rows, cols, data FROM matches ORDER BY pair_id");
  while (statement.Step()) {
    function(ImagePairFromPairId(statement.Int(0)),
             MatchesFromRow(statement, "matches", 1));
  }
}

void CountMatches(
    SqliteConnection* database, const std::string& table, int min_num_matches,
    const std::function<void(const ImagePair&, int64_t)>& function) {
  SqliteStatement statement(database, "SELECT pair_id, rows FROM " + table +
                                          " WHERE rows >= ? ORDER BY pair_id");
  statement.BindInt(1, min_num_matches);
  while (statement.Step()) {
    function(ImagePairFromPairId(statement.Int(0)), statement.Int(1));
  }
}

std::vector<FeatureMatch> ReadMatchesOfPair(SqliteConnection* database,
                                            const std::string& table,
                                            const ImagePair& pair) {
  SqliteStatement statement(database, "SELECT pair_id, rows, cols, data FROM " +
                                          table + " WHERE pair_id = ?");
  statement.BindInt(1, PairIdFromImagePair(pair));
  return statement.Step() ? MatchesFromRow(statement, table, 1)
                          : std::vector<FeatureMatch>();
}

std::vector<DatabaseTwoViewGeometry> ReadTwoViewGeometries(
    SqliteConnection* database, const std::string& table, int min_num_matches) {
  std::vector<DatabaseTwoViewGeometry> rows;
  // COLMAP 3.6 has no poses.
  const std::string poses =
      HasColumn(database, table, "qvec") && HasColumn(database, table, "tvec")
          ? "qvec, tvec"
          : "NULL, NULL";
  SqliteStatement statement(
      database, "SELECT pair_id, rows, cols, data, config, E, " + poses +
                    " FROM " + table + " WHERE rows >= ? ORDER BY pair_id");
  statement.BindInt(1, min_num_matches);
  while (statement.Step()) {
    DatabaseTwoViewGeometry row;
    row.pair = ImagePairFromPairId(statement.Int(0));
    row.inlier_matches = MatchesFromRow(statement, table, 1);
    row.config = statement.Int(4);
    const Eigen::Matrix3d E =
        MatrixFromRow<RowMajorMatrix3d>(statement, table, 5);
    if (!E.isZero()) row.essential_matrix = E;
    row.cam2_from_cam1 =
        PoseFromBlobs(MatrixFromRow<Eigen::Vector4d>(statement, table, 6),
                      MatrixFromRow<Eigen::Vector3d>(statement, table, 7));
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace adasfm
