BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0002');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('f02a887d8ff349869c9c521293c991e8','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('7fe474262e114c38b809e88c157200ed','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79534835878798961642e+09,'cancel-job','alice','023a08ab39eb479098e26064d69c1045','0123456789abcdef','192.0.2.1');
INSERT INTO "audit" VALUES(2,1.79534835879398441309e+09,'delete-job','alice','023a08ab39eb479098e26064d69c1045',NULL,'command line');
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
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79534835871999549862e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('f02a887d8ff349869c9c521293c991e8',1,'queued','{}',1.79534835872599029538e+09);
INSERT INTO "events" VALUES('f02a887d8ff349869c9c521293c991e8',2,'running','{"attempt": 1}',1.79534835873999142649e+09);
INSERT INTO "events" VALUES('f02a887d8ff349869c9c521293c991e8',3,'progress','{"generation": 3}',1.79534835874401473999e+09);
INSERT INTO "events" VALUES('f02a887d8ff349869c9c521293c991e8',4,'succeeded','{"best": 0.5}',1.79534835875198101997e+09);
INSERT INTO "events" VALUES('7fe474262e114c38b809e88c157200ed',1,'queued','{}',1.79534835876199913018e+09);
INSERT INTO "events" VALUES('7fe474262e114c38b809e88c157200ed',2,'running','{"attempt": 1}',1.79534835876598215104e+09);
INSERT INTO "events" VALUES('7fe474262e114c38b809e88c157200ed',3,'progress','{"generation": 3}',1.79534835876899957654e+09);
INSERT INTO "events" VALUES('7fe474262e114c38b809e88c157200ed',4,'failed','{"type": "broken", "detail": "it broke"}',1.79534835877398848535e+09);
INSERT INTO "events" VALUES('70c184af1b214622a45b23cade64e9eb',1,'queued','{}',1.79534835877700591085e+09);
INSERT INTO "events" VALUES('70c184af1b214622a45b23cade64e9eb',2,'cancelled','{}',1.7953483587809891701e+09);
INSERT INTO "events" VALUES('46395d2f7e4b4624ba39a237cacc5eab',1,'queued','{}',1.79534835879700183872e+09);
INSERT INTO "events" VALUES('46395d2f7e4b4624ba39a237cacc5eab',2,'running','{"attempt": 1}',1.79534835880899143216e+09);
INSERT INTO "events" VALUES('46395d2f7e4b4624ba39a237cacc5eab',3,'progress','{"generation": 5}',1.7953483588120088577e+09);
INSERT INTO "events" VALUES('6dd363efaae74d81902ccc330eb6b2ce',1,'queued','{}',1.79534835881498599056e+09);
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
INSERT INTO "jobs" VALUES('f02a887d8ff349869c9c521293c991e8','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79535195873999142649e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79534835872599029538e+09,1.79534835875198101997e+09,1.79534835873999142649e+09,1.79534835875198101997e+09,'0.1.0','0.1.0','0.1.0',0.0,'');
INSERT INTO "jobs" VALUES('7fe474262e114c38b809e88c157200ed','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79535195876598215099e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79534835876199913018e+09,1.79534835877398848535e+09,1.79534835876598215104e+09,1.79534835877398848535e+09,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('70c184af1b214622a45b23cade64e9eb','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79534835877700591085e+09,1.7953483587809891701e+09,NULL,1.7953483587809891701e+09,'0.1.0',NULL,NULL,0.0,'');
INSERT INTO "jobs" VALUES('46395d2f7e4b4624ba39a237cacc5eab','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'82d6e57fca274b44b1503cf627a1c788',1,1.79535195880899143216e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79534835879700183872e+09,1.7953483588120088577e+09,1.79534835880899143216e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('6dd363efaae74d81902ccc330eb6b2ce','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79534835881498599056e+09,1.79534835881498599056e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'');
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
INSERT INTO "keys" VALUES('489626b8254833c6','alice','revoked','8ace08ea00194ec5d428c404b7a590eea0f777e15fb6bf319fa8ff67b37b3987','["read", "write"]',1.79534835870901203153e+09,1.79535195870901203153e+09,1.79534835871500682833e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('f02a887d8ff349869c9c521293c991e8',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('f02a887d8ff349869c9c521293c991e8',2,'{"fitness": 0.7}','second');
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('f02a887d8ff349869c9c521293c991e8',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('7fe474262e114c38b809e88c157200ed',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('46395d2f7e4b4624ba39a237cacc5eab',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('f02a887d8ff349869c9c521293c991e8','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','023a08ab39eb479098e26064d69c1045','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79534835878698372834e+09);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_jobs_queue ON jobs (state, priority DESC, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
COMMIT;
