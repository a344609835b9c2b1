// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/merge_rows.h"

#include <algorithm>
#include <map>
#include <vector>

#include "colmap_ext/database/swap_pair.h"
#include "colmap_ext/host/database.h"
#include "core/types.h"

namespace adasfm {
namespace {

using Row = std::map<std::string, SqliteValue>;

// The ids that replace the values of a column; null for other columns.
const std::map<int64_t, int64_t>* IdsOfColumn(const std::string& column,
                                              const MergedIds& ids) {
  for (const char* name : {"camera_id", "sensor_id", "ref_sensor_id",
                           "corr_sensor_id", "reference_camera_id"}) {
    if (column == name) return &ids.cameras;
  }
  for (const char* name :
       {"image_id", "image_id1", "image_id2", "data_id", "corr_data_id"}) {
    if (column == name) return &ids.images;
  }
  if (column == "rig_id") return &ids.rigs;
  if (column == "frame_id") return &ids.frames;
  return nullptr;
}

bool IsNameColumn(const std::string& table, const std::string& column) {
  return (table == "images" || table.rfind("adasfm_", 0) == 0) &&
         (column == "name" || column == "name1" || column == "name2");
}

int64_t NewId(const std::map<int64_t, int64_t>& ids, int64_t old_id,
              const std::string& column) {
  const auto id = ids.find(old_id);
  if (id != ids.end()) return id->second;
  throw SqliteError("column " + column + " names the id " +
                    std::to_string(old_id) + ", which is missing");
}

// Replaces the pair's id; true when its images change their order.
bool RenumberPair(const MergedIds& ids, int64_t* pair_id) {
  const ImagePair old_pair = ImagePairFromPairId(*pair_id);
  const int64_t id1 = NewId(ids.images, old_pair.image_id1, "pair_id");
  const int64_t id2 = NewId(ids.images, old_pair.image_id2, "pair_id");
  *pair_id = PairIdFromImagePair(ImagePair(id1, id2));
  return id1 > id2;
}

// COLMAP deletes images but not their rows in the adasfm_ tables.
bool IsOfMissingImage(const std::string& table, const Row& row,
                      const MergedIds& ids) {
  if (table.rfind("adasfm_", 0) != 0) return false;
  for (const auto& [column, value] : row) {
    if (IdsOfColumn(column, ids) != &ids.images) continue;
    if (ids.images.count(std::get<int64_t>(value)) == 0) return true;
  }
  return false;
}

void Renumber(const std::string& table, const std::string& prefix,
              const MergedIds& ids, Row* row) {
  for (auto& [column, value] : *row) {
    auto* id = std::get_if<int64_t>(&value);
    if (const auto* column_ids = IdsOfColumn(column, ids)) {
      if (id == nullptr) throw SqliteError("column " + column + " has no id");
      *id = NewId(*column_ids, *id, column);
    } else if (IsNameColumn(table, column)) {
      value = prefix + std::get<std::string>(value);
    }
  }
  const auto pair_id = row->find("pair_id");
  if (pair_id != row->end() &&
      RenumberPair(ids, &std::get<int64_t>(pair_id->second))) {
    SwapPair(row);
  }
}

// The columns that identify a row: the primary key or, for tables whose primary
// key does not, the sensors' key.
std::vector<std::string> KeyColumns(const std::string& table,
                                    SqliteConnection* database) {
  if (table == "rig_sensors") return {"sensor_id", "sensor_type"};
  if (table == "frame_data") return {"data_id", "sensor_type"};
  std::vector<std::string> columns;
  const std::vector<std::string> all = database->Columns(table);
  if (table == "pose_priors" &&
      std::find(all.begin(), all.end(), "pose_prior_id") != all.end()) {
    return {"corr_data_id", "corr_sensor_id", "corr_sensor_type"};
  }
  SqliteStatement statement(
      database, "SELECT name FROM pragma_table_info(?) WHERE pk > 0");
  statement.BindText(1, table);
  while (statement.Step()) columns.push_back(statement.Text(0));
  return columns.empty() ? all : columns;
}

std::string JoinColumns(const std::vector<std::string>& columns,
                        const std::string& before, const std::string& between,
                        const std::string& after) {
  std::string text;
  for (const std::string& column : columns) {
    text += (text.empty() ? "" : between) + before + column + after;
  }
  return text;
}

// Inserts rows into one table.
class RowWriter {
 public:
  RowWriter(const std::string& table, std::vector<std::string> columns,
            SqliteConnection* database)
      : columns_(std::move(columns)),
        key_columns_(KeyColumns(table, database)),
        find_(database,
              "SELECT " + JoinColumns(columns_, "\"", ", ", "\"") + " FROM " +
                  table + " WHERE " +
                  JoinColumns(key_columns_, "\"", " AND ", "\" IS ?")),
        insert_(database, "INSERT INTO " + table + " (" +
                              JoinColumns(columns_, "\"", ", ", "\"") +
                              ") VALUES (" + Marks(columns_.size()) + ")") {}

  // True for a new row; throws when a different row with the same key exists.
  bool Write(const Row& row) {
    find_.Reset();
    for (size_t i = 0; i < key_columns_.size(); ++i) {
      find_.BindValue(i + 1, row.at(key_columns_[i]));
    }
    if (find_.Step()) {
      for (size_t i = 0; i < columns_.size(); ++i) {
        if (find_.Value(i) == row.at(columns_[i])) continue;
        throw SqliteError("another row with another " + columns_[i] +
                          " is there already");
      }
      return false;
    }
    insert_.Reset();
    for (size_t i = 0; i < columns_.size(); ++i) {
      insert_.BindValue(i + 1, row.at(columns_[i]));
    }
    insert_.Step();
    return true;
  }

 private:
  static std::string Marks(size_t count) {
    std::string marks;
    for (size_t i = 0; i < count; ++i) marks += i == 0 ? "?" : ", ?";
    return marks;
  }

  std::vector<std::string> columns_;
  std::vector<std::string> key_columns_;
  SqliteStatement find_;
  SqliteStatement insert_;
};

// Describes the subject of a row for an error message.
std::string DescribeRow(const DatabaseKeys& input, const Row& row) {
  const auto name = [&input](int64_t id) {
    const auto image = input.images.find(id);
    return image == input.images.end() ? std::to_string(id)
                                       : image->second.name;
  };
  const auto pair_id = row.find("pair_id");
  if (pair_id != row.end()) {
    const ImagePair pair =
        ImagePairFromPairId(std::get<int64_t>(pair_id->second));
    return "images " + name(pair.image_id1) + " and " + name(pair.image_id2);
  }
  const auto image_id = row.find("image_id");
  if (image_id != row.end()) {
    return "image " + name(std::get<int64_t>(image_id->second));
  }
  return "a row";
}

}  // namespace

int64_t MergeRows(const std::string& table, const DatabaseKeys& input,
                  const MergedIds& ids, SqliteConnection* source,
                  SqliteConnection* target) {
  std::vector<std::string> columns = source->Columns(table);
  // SQLite assigns these ids; no other table refers to them.
  columns.erase(std::remove(columns.begin(), columns.end(), "pose_prior_id"),
                columns.end());
  RowWriter writer(table, columns, target);
  SqliteStatement statement(source, "SELECT " +
                                        JoinColumns(columns, "\"", ", ", "\"") +
                                        " FROM " + table + " ORDER BY rowid");
  int64_t num_new_rows = 0;
  while (statement.Step()) {
    Row row;
    for (size_t i = 0; i < columns.size(); ++i) {
      row[columns[i]] = statement.Value(i);
    }
    if (IsOfMissingImage(table, row, ids)) continue;
    std::string subject;
    try {
      subject = DescribeRow(input, row);
      Renumber(table, input.prefix, ids, &row);
      if (writer.Write(row)) ++num_new_rows;
    } catch (const std::exception& error) {
      throw SqliteError(input.path + ", table " + table + ", " + subject +
                        ": " + error.what());
    }
  }
  return num_new_rows;
}

}  // namespace adasfm
