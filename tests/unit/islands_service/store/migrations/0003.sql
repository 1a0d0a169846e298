BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0003');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('2ada9abfd60a4ca995b162b8ff40904e','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('7b3240f401fd4a56aa12e33804e2ed1d','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79535255466500973707e+09,'cancel-job','alice','16d0d171e58f497d8f1619b28a04b856','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.7953525546720101833e+09,'delete-job','alice','16d0d171e58f497d8f1619b28a04b856',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79535255461499977116e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('2ada9abfd60a4ca995b162b8ff40904e',1,'queued','{}',1.79535255461998891827e+09);
INSERT INTO "events" VALUES('2ada9abfd60a4ca995b162b8ff40904e',2,'running','{"attempt": 1}',1.79535255463000679009e+09);
INSERT INTO "events" VALUES('2ada9abfd60a4ca995b162b8ff40904e',3,'progress','{"generation": 3}',1.79535255463298416139e+09);
INSERT INTO "events" VALUES('2ada9abfd60a4ca995b162b8ff40904e',4,'succeeded','{"best": 0.5}',1.79535255463801336284e+09);
INSERT INTO "events" VALUES('7b3240f401fd4a56aa12e33804e2ed1d',1,'queued','{}',1.79535255464601969715e+09);
INSERT INTO "events" VALUES('7b3240f401fd4a56aa12e33804e2ed1d',2,'running','{"attempt": 1}',1.79535255464899683001e+09);
INSERT INTO "events" VALUES('7b3240f401fd4a56aa12e33804e2ed1d',3,'progress','{"generation": 3}',1.79535255465100860596e+09);
INSERT INTO "events" VALUES('7b3240f401fd4a56aa12e33804e2ed1d',4,'failed','{"type": "broken", "detail": "it broke"}',1.79535255465398573869e+09);
INSERT INTO "events" VALUES('9f7c07defd3a4ffbb2634ff763282218',1,'queued','{}',1.79535255465700340276e+09);
INSERT INTO "events" VALUES('9f7c07defd3a4ffbb2634ff763282218',2,'cancelled','{}',1.79535255466098642345e+09);
INSERT INTO "events" VALUES('225b8fecb9164b5e8b859146f5eed27a',1,'queued','{}',1.79535255467301607138e+09);
INSERT INTO "events" VALUES('225b8fecb9164b5e8b859146f5eed27a',2,'running','{"attempt": 1}',1.79535255467699909207e+09);
INSERT INTO "events" VALUES('225b8fecb9164b5e8b859146f5eed27a',3,'progress','{"generation": 5}',1.79535255467901086806e+09);
INSERT INTO "events" VALUES('47ea2ebc86d34053afae7f2b5de4ead7',1,'queued','{}',1.79535255468001651761e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('2ada9abfd60a4ca995b162b8ff40904e','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79535615463000679022e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79535255461998891827e+09,1.79535255463801336284e+09,1.79535255463000679009e+09,1.79535255463801336284e+09,'0.1.0','0.1.0','0.1.0',0.0,'');
INSERT INTO "jobs" VALUES('7b3240f401fd4a56aa12e33804e2ed1d','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79535615464899682997e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79535255464601969715e+09,1.79535255465398573869e+09,1.79535255464899683001e+09,1.79535255465398573869e+09,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('9f7c07defd3a4ffbb2634ff763282218','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79535255465700340276e+09,1.79535255466098642345e+09,NULL,1.79535255466098642345e+09,'0.1.0',NULL,NULL,0.0,'');
INSERT INTO "jobs" VALUES('225b8fecb9164b5e8b859146f5eed27a','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'1d07d85d3a4e4a74a12ba94eb0fd15f1',1,1.79535255367699909207e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79535255467301607138e+09,1.79535255467901086806e+09,1.79535255467699909207e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('47ea2ebc86d34053afae7f2b5de4ead7','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79535255468001651761e+09,1.79535255468001651761e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'');
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('ba4e56be7b92de46','alice','revoked','bb3ec1a6e8adea5d79138901a89c780bbb44572ad3ee82ea2c6f3fc0f461ec62','["read", "write"]',1.79535255460699343685e+09,1.79535615460699343685e+09,1.79535255461101675034e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('2ada9abfd60a4ca995b162b8ff40904e',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('2ada9abfd60a4ca995b162b8ff40904e',2,'{"fitness": 0.7}','second');
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('2ada9abfd60a4ca995b162b8ff40904e',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('7b3240f401fd4a56aa12e33804e2ed1d',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('225b8fecb9164b5e8b859146f5eed27a',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('2ada9abfd60a4ca995b162b8ff40904e','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','16d0d171e58f497d8f1619b28a04b856','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79535255466400384899e+09);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id);
COMMIT;
