// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sqlite.h"
#include "core/status.h"

namespace adasfm {

// The tables of COLMAP 3.6 to 4.2 differ (docs/reference/formats.md). The
// number in user_version does not distinguish the versions: 3.9 to 3.13 write
// the same number, and an older program writes its own number into a newer
// file. The functions below therefore look at a file's tables and columns.

bool HasColumn(SqliteConnection* database, const std::string& table,
               const std::string& column);

// An error, naming the table or column, when one is missing that every COLMAP
// since 3.6 writes.
Status CheckColumns(const std::string& path, SqliteConnection* database);

// The tables that only COLMAPs newer than 3.8 write. The library of 3.8 must
// not open a file that has any: it would write its own version number and end
// the process.
std::vector<std::string> FindNewerTables(SqliteConnection* database);

// Whether the file has COLMAP 3.10's form, which COLMAP 4 converts only in
// part: its pose_priors lack the column position_covariance.
bool IsHalfConvertible(SqliteConnection* database);

// Why the linked library must not open the file, as text that follows the
// file's name; empty when it may. Each host/vN has its own answer.
std::string WhyLibraryMustNotOpen(SqliteConnection* database);

// An error for a file that the linked library must not open. A file that does
// not exist yet, or is empty, may be opened. Changes nothing.
Status CheckLibraryOpens(const std::string& database_path);

// Whether the file has COLMAP 4's form: NULL marks a two-view geometry's
// missing pose or matrix, while zeros and the identity are values.
bool StoresMissingAsNull(SqliteConnection* database);

// Adds the columns qvec and tvec to two_view_geometries when they are missing,
// as COLMAP 3.7 and later do with a file of COLMAP 3.6.
void AddPoseColumns(SqliteConnection* database);

}  // namespace adasfm
